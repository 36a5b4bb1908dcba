"""The data set card: README.md, with the front matter that Hugging Face reads."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple
from urllib.parse import quote

import yaml
from jinja2 import Environment, StrictUndefined

from advpipe.pipeline.bag import plain_yaml
from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.dataset.layout import Layout
from advpipe.stages.share import names
from advpipe.stages.share.effects import banners, effect_tables
from advpipe.stages.share.facts import CLOUD_TYPE, BagFacts, TopicFacts
from advpipe.stages.share.options import ShareOptions
from advpipe.stages.share.pictures import Picture

_HUB_LICENCES = (
    "apache-2.0", "mit", "cc0-1.0", "cc-by-4.0", "cc-by-sa-4.0", "cc-by-nc-4.0", "cc-by-nc-sa-4.0", "odbl",
    "gpl-3.0", "bsd-3-clause",
)  # fmt: skip
"""Those of Hugging Face's keys that are SPDX identifiers in lower case; others are `other` there."""

_WHAT = {
    "scenario.yaml": "the scenario, every default spelt out; `advpipe simulate` makes the drive of it again",
    "clean": "the recorded drive, a rosbag2 folder",
    "reports": "measured effect of the attacks",
    names.CHECKS: "what each bag promises, for baglint and Backplane Tracecheck",
    names.PLAY: "layouts for Foxglove and RViz",
    names.FIGURES: "the pictures of this page",
    names.MESSAGES: "our own message types, a ROS 2 package",
}  # fmt: skip
_ATTACK = "an adversarial version of it, playable alone, with its labels"
_DRIVE = "another recorded drive; its own record holds its scenario"
_POINT_TYPES = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
"""numpy's names of sensor_msgs/PointField's types."""


_ORIGIN = ("latitude_deg", "longitude_deg", "altitude_m")
_LIDAR = (
    *("preset", "vehicle", "channels", "points_per_second", "rotation_frequency", "range"),
    *("x_m", "y_m", "z_m"),
)


class _Attack(NamedTuple):
    name: str
    title: str
    parameters: str
    aim: str
    seed: str
    frames: str


def write_card(
    name: str,
    found: Layout,
    bags: Sequence[BagFacts],
    sums: Mapping[str, str],
    drives: Mapping[str, BagFacts],
    options: ShareOptions,
    remarks: Sequence[str],
    pictures: Sequence[Picture],
) -> str:
    """The card's text; bags: the clean one first.

    sums: checksums of the data set's files, by path. drives: the bags that are no attacks, by SHA-256.
    """
    clean, attacks = bags[0], [bag for bag in bags if bag.is_attack]
    scenario = _scenario(clean)
    first = clean.lidars[0] if clean.lidars else next(iter(clean.topics.values()))
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)
    environment.filters |= {"cell": cell, "link": quote, "word": shlex.quote}
    template = environment.from_string(
        (files("advpipe.stages.share") / "card.md").read_text(encoding="utf-8")
    )
    return template.render(
        front_matter=_front_matter(name, clean, attacks, options),
        mark=names.CARD_MARK,
        name=name,
        description=" ".join(str(scenario.get("description") or "").split()),
        is_simulated=clean.provenance.get("kind") == "clean",
        version=_json(clean, "versions").get("advpipe", ""),
        clean=clean,
        bags=bags,
        attacks=[_attack(bag) for bag in attacks],
        pictures=pictures,
        contents=list(_contents(found, bags, pictures)),
        digest_of=lambda bag: _digest_of(bag, found, sums),
        chain=_chain(attacks, drives),
        other_drives=len(drives) - 1,
        rate=_rate,
        lidars=list(_lidars(scenario)),
        origin=_origin(clean, scenario),
        banners=banners(found.reports),
        effects=effect_tables(found.reports),
        has_messages=any(topic.type.startswith("advpipe_msgs/") for topic in clean.topics.values()),
        first_topic=first.name,
        first_fields=_numpy_fields(clean, first),
        clean_file=mcap_files(clean.path)[0].name,
        is_signed=options.sign is not None,
        licence=options.licence or "None stated: ask the author before you use the data.",
        citation=f"```\n{options.citation}\n```" if options.citation else "None given.",
        remarks=remarks,
        own_words=_own_words(found),
    )


def cell(text: object) -> str:
    """Text as a cell of a table in Markdown."""
    return " ".join(str(text).split()).replace("|", "\\|")


def _front_matter(name: str, clean: BagFacts, attacks: Sequence[BagFacts], options: ShareOptions) -> str:
    tags = ["autonomous-driving", "simulation", "ros2", "mcap"]
    tags += ["lidar", "point-cloud"] if clean.lidars else []
    tags += ["v2x"] if clean.description.v2x is not None else []
    tags += ["adversarial-attacks", "robustness"] if attacks else []
    document: dict[str, Any] = {"pretty_name": name, "tags": tags}
    if options.licence is not None:
        is_known = options.licence.lower() in _HUB_LICENCES
        document["license"] = options.licence.lower() if is_known else "other"
        if not is_known:
            document["license_name"] = options.licence
    if clean.truths:
        document["task_categories"] = ["object-detection"]
    return f"---\n{yaml.safe_dump(document, sort_keys=False, allow_unicode=True)}---"


def _scenario(clean: BagFacts) -> dict[str, Any]:
    """The resolved scenario of the drive's record; empty for another tool's bag."""
    try:
        document = plain_yaml.load(clean.provenance.get("scenario", ""))
    except (yaml.YAMLError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}


def _part(document: Mapping[str, Any], *keys: str) -> Mapping[str, Any]:
    """What lies in a document under keys; empty where that has no keys of its own."""
    found: Any = document
    for key in keys:
        found = found.get(key) if isinstance(found, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _lidars(scenario: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Name and properties of each; None for one that the release that recorded the drive did not know."""
    for name, lidar in _part(scenario, "sensors", "lidars").items():
        if isinstance(lidar, Mapping):
            yield {"name": name} | {key: lidar.get(key) for key in _LIDAR}


def _json(bag: BagFacts, key: str) -> dict[str, Any]:
    """An entry of a bag's record that is JSON; empty where it is none."""
    try:
        document = json.loads(bag.provenance.get(key, "{}"))
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def _origin(clean: BagFacts, scenario: Mapping[str, Any]) -> dict[str, str]:
    """Map, seed and versions, as far as the bag says."""
    about = clean.provenance
    place = _part(scenario, "map")
    sources = {key: value for key, value in place.items() if key != "origin" and value}
    facts = {
        "scenario": about.get("scenario_name", ""),
        "map": ", ".join(f"{key} {value}" for key, value in sources.items()),
        "map's SHA-256": about.get("map_sha256", ""),
        "seed": about.get("seed", ""),
    }
    if origin := _part(place, "origin"):
        latitude, longitude, altitude = (origin.get(key) for key in _ORIGIN)
        facts["origin"] = f"{latitude}° N, {longitude}° E, {altitude} m"
    versions = _json(clean, "versions")
    facts["versions"] = ", ".join(f"{package} {number}" for package, number in versions.items() if number)
    return {key: value for key, value in facts.items() if value} or {
        "recorded by": "another tool than advpipe"
    }


def _attack(bag: BagFacts) -> _Attack:
    about = bag.provenance
    recipe = about.get("recipe", "")
    title = about.get("attack", "unknown") + (f", recipe {recipe}" if recipe else "")
    words = ", ".join(f"{key} {json.dumps(value)}" for key, value in _json(bag, "parameters").items())
    aim = "; ".join(_aims(bag))
    return _Attack(bag.path.name, title, words, aim, about.get("seed", ""), about.get("frames", ""))


def _aims(bag: BagFacts) -> Iterator[str]:
    """Of each attack in a bag: who lies, whom it harms, which detector it looked at, and when it acts."""
    try:
        attacks = json.loads(bag.provenance.get("attacks", "[]"))
    except (ValueError, RecursionError):
        attacks = []
    attacks = [one for one in attacks if isinstance(one, Mapping)] if isinstance(attacks, list) else []
    for one in attacks:
        facts = {f"attackers' {key}": value for key, value in _part(one, "attackers").items()}
        facts |= {key: one.get(key) for key in ("victim", "lidar", "detector")}
        facts |= _part(one, "schedule")
        told = [f"{key} {_plain(value)}" for key, value in facts.items() if value not in (None, "", [])]
        yield (f"{one.get('type')}: " if len(attacks) > 1 else "") + ", ".join(told)


def _plain(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _contents(
    found: Layout, bags: Sequence[BagFacts], pictures: Sequence[Picture]
) -> Iterator[dict[str, str]]:
    for bag in bags:
        what = _WHAT.get(bag.path.name) or (_ATTACK if bag.is_attack else _DRIVE)
        yield {"name": bag.path.name, "link": bag.path.name, "size": f"{bag.description.bytes / 1e6:.1f} MB",
               "what": what}  # fmt: skip
    if found.scenario is not None:
        yield {"name": "scenario.yaml", "link": "scenario.yaml", "size": "", "what": _WHAT["scenario.yaml"]}
    for report in found.reports:
        place = report.relative_to(found.folder).as_posix()
        page = f"{place}/report.html" if (report / "report.html").is_file() else place
        yield {"name": place, "link": page, "size": "", "what": _WHAT["reports"]}
    folders = [names.PLAY, names.CHECKS, *([names.FIGURES] if pictures else [])]
    if any(topic.type.startswith("advpipe_msgs/") for topic in bags[0].topics.values()):
        folders.append(names.MESSAGES)
    for folder in folders:
        yield {"name": folder, "link": folder, "size": "", "what": _WHAT[folder]}


def _digest_of(bag: BagFacts, found: Layout, sums: Mapping[str, str]) -> str:
    of_bag = [sums[file.relative_to(found.folder).as_posix()] for file in mcap_files(bag.path)]
    return of_bag[0] if len(of_bag) == 1 else "several files, see SHA256SUMS"


def _chain(attacks: Sequence[BagFacts], drives: Mapping[str, BagFacts]) -> str:
    """What ties the adversarial bags to a drive; run.py refused any that states another parent."""
    lines = []
    for sha256, drive in drives.items():
        tied = [f"`{bag.path.name}`" for bag in attacks if bag.provenance.get("parent_sha256") == sha256]
        if tied:
            place = f"`{drive.path.name}`"
            lines.append(
                f"the records of {', '.join(tied)} name the SHA-256 of {place}, of which they were made"
            )
    return f"Provenance: {'; '.join(lines)}." if lines else ""


def _rate(topic: TopicFacts) -> str:
    if topic.count == 1:
        return "once"
    return f"{topic.rate_hz:.1f} Hz" if topic.rate_hz else ""


def _numpy_fields(clean: BagFacts, topic: TopicFacts) -> str:
    """The structured type of a cloud topic's points as Python text; empty for another topic."""
    if topic.type != CLOUD_TYPE:
        return ""
    _, message = next(BagReader(clean.path).messages(topic.name))
    fields = message.fields
    parts = {
        "names": [field.name for field in fields],
        "formats": [_POINT_TYPES[field.datatype] for field in fields],
        "offsets": [int(field.offset) for field in fields],
        "itemsize": int(message.point_step),
    }
    return f"np.dtype({parts})"


def _own_words(found: Layout) -> str:
    """What the author wrote into the data set's README.md, unless sharing made that."""
    text = found.card.read_text(encoding="utf-8", errors="replace") if found.card else ""
    return "" if names.CARD_MARK in text else text.strip()
