"""The data set card: README.md, with the front matter that Hugging Face reads."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Annotated, Any, NamedTuple

import yaml
from jinja2 import Environment, StrictUndefined
from pydantic import ConfigDict, Field

from advpipe.pipeline.bag.carried import CLOUD_TYPE, CarriedSensor
from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_source import read_source
from advpipe.pipeline.core.document import Document, Number, ShortText, Text, read_yaml
from advpipe.pipeline.core.errors import one_line
from advpipe.pipeline.dataset.layout import Layout
from advpipe.pipeline.sensors.registry import SENSORS
from advpipe.stages.share import names
from advpipe.stages.share.audit_table import audit_table
from advpipe.stages.share.effects import effect_tables, report_warnings
from advpipe.stages.share.facts import BagFacts, TopicFacts
from advpipe.stages.share.markdown import Markdown, authors_text, block, code, escaped, link, literal
from advpipe.stages.share.options import ShareOptions
from advpipe.stages.share.pictures import SharedPicture

_HUB_LICENCES = (
    "apache-2.0", "mit", "cc0-1.0", "cc-by-4.0", "cc-by-sa-4.0", "cc-by-nc-4.0", "cc-by-nc-sa-3.0",
    "cc-by-nc-sa-4.0", "odbl", "gpl-3.0", "bsd-3-clause",
)  # fmt: skip
"""Hugging Face's licence keys that are SPDX identifiers in lower case; other licences are `other` there."""

_WHAT = {
    "scenario.yaml": Markdown(
        "the scenario with all defaults; `advpipe simulate` reproduces the drive from it"
    ),
    "source.yaml": Markdown("where the drive was imported from, with its licence and the options"),
    "clean": Markdown("the recorded drive, a rosbag2 folder"),
    "reports": Markdown("measured effect of the attacks"),
    names.CHECKS: Markdown("properties of each bag, for the checkers baglint and Backplane Tracecheck"),
    names.PLAY: Markdown("layouts for Foxglove and RViz"),
    names.FIGURES: Markdown("the pictures of this page"),
    names.MESSAGES: Markdown("our own message types, a ROS 2 package"),
}  # fmt: skip
_ATTACK = "an adversarial version of it, playable alone, with its labels"
_DRIVE = "another recorded drive; its provenance contains its scenario"
_POINT_TYPES = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}
"""numpy's names of sensor_msgs/PointField's types."""


_Figure = Annotated[int, Field(strict=True)] | Number


class _Origin(Document):
    latitude_deg: Number
    longitude_deg: Number
    altitude_m: Number


class _CardMap(Document):
    """The map's origin, and its sources as plain values."""

    model_config = ConfigDict(extra="allow")

    origin: _Origin | None = None


class _Lidar(Document):
    """A LiDAR; None for keys that the release that recorded the drive did not have."""

    preset: ShortText | None = None
    vehicle: ShortText | None = None
    channels: _Figure | None = None
    points_per_second: _Figure | None = None
    rotation_frequency: _Figure | None = None
    range: _Figure | None = None
    x_m: _Figure | None = None
    y_m: _Figure | None = None
    z_m: _Figure | None = None


class _Sensors(Document):
    lidars: dict[ShortText, _Lidar] = Field(default_factory=dict)


class RecordedScenario(Document):
    """The part of a resolved scenario, of any release, that a card shows."""

    description: Text = ""
    map: _CardMap = _CardMap()
    sensors: _Sensors = _Sensors()


class _Attack(NamedTuple):
    name: str
    title: str
    parameters: str
    aim: str
    seed: str
    frames: str


class _Sensor(NamedTuple):
    title: str
    name: str
    vehicle: str
    topics: list[str]


def write_card(
    name: str,
    found: Layout,
    bags: Sequence[BagFacts],
    sums: Mapping[str, str],
    drives: Mapping[str, BagFacts],
    options: ShareOptions,
    warnings: Sequence[str],
    pictures: Sequence[SharedPicture],
) -> str:
    """The card's text; bags: the clean one first.

    sums: checksums of the data set's files, by path. drives: the bags that are not adversarial, by SHA-256.
    """
    clean, attacks = bags[0], [bag for bag in bags if bag.is_attack]
    scenario = _scenario(clean)
    first = clean.lidars[0] if clean.lidars else next(iter(clean.topics.values()))
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, finalize=escaped)
    environment.filters |= {"code": code, "link": link, "literal": literal, "argument": _argument}
    template = environment.from_string(
        (files("advpipe.stages.share") / "card.md").read_text(encoding="utf-8")
    )
    return template.render(
        front_matter=Markdown(_front_matter(name, clean, attacks, options)),
        mark=Markdown(names.CARD_MARK),
        name=name,
        description=scenario.description,
        is_simulated=clean.provenance.fields.kind == "clean" and not clean.provenance.fields.source,
        is_imported=bool(clean.provenance.fields.source),
        version=clean.provenance.fields.versions.get("advpipe", ""),
        clean=clean,
        bags=bags,
        attacks=[_attack(bag) for bag in attacks],
        pictures=pictures,
        contents=list(_contents(found, bags, pictures)),
        digest_of=lambda bag: _digest_of(bag, found, sums),
        chain=_chain(attacks, drives),
        other_drives=len(drives) - 1,
        rate=_rate,
        lidars=[{"name": name, **dict(lidar)} for name, lidar in scenario.sensors.lidars.items()],
        sensors=_sensors(clean),
        origin=_origin(clean, scenario),
        warnings=report_warnings(found.reports),
        effects=effect_tables(found.reports),
        audit=audit_table(found) if attacks else None,
        has_messages=any(topic.type.startswith("advpipe_msgs/") for topic in clean.topics.values()),
        first_topic=first.name,
        first_fields=_numpy_fields(clean, first),
        clean_file=mcap_files(clean.path)[0].name,
        is_signed=options.sign is not None,
        licence=options.licence or "None stated: ask the author before you use the data.",
        citation=block(options.citation) if options.citation else "None given.",
        notes=warnings,
        authors_notes=_authors_notes(found),
    )


def _argument(text: str) -> Markdown:
    """One argument of a command line in a code block."""
    return Markdown(shlex.quote(one_line(text)))


def _front_matter(name: str, clean: BagFacts, attacks: Sequence[BagFacts], options: ShareOptions) -> str:
    is_imported = bool(clean.provenance.fields.source)
    tags = ["autonomous-driving", *([] if is_imported else ["simulation"]), "ros2", "mcap"]
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


def _scenario(clean: BagFacts) -> RecordedScenario:
    """The scenario in the drive's provenance; empty for another tool's bag.

    Raises AdvpipeError for an invalid scenario.
    """
    text = clean.provenance.fields.scenario
    if not text.strip():
        return RecordedScenario()
    where = f"{clean.path}: the provenance record: scenario"
    found: RecordedScenario = read_yaml(text, RecordedScenario, where, "record the bag again")
    return found


def _sensors(clean: BagFacts) -> list[_Sensor]:
    """The drive's sensors with a topic in the bag, in the registry's order; none for another tool's bag."""
    carried = clean.sensors or {}
    topics: dict[CarriedSensor, list[str]] = {}
    for name, sensor in carried.items():
        if name in clean.topics:
            topics.setdefault(sensor, []).append(name)
    return [
        _Sensor(each.kind.title, each.name, each.vehicle, sorted(topics[each]))
        for each in sorted(topics, key=lambda each: (list(SENSORS).index(each.key), each.vehicle, each.name))
    ]


def _origin(clean: BagFacts, scenario: RecordedScenario) -> dict[str, str]:
    """Map, seed and versions, as far as the bag records them."""
    about, place = clean.provenance, scenario.map
    sources = {key: value for key, value in (place.model_extra or {}).items() if value}
    source = about.get("source", "")
    facts = {
        "imported drive" if source else "scenario": about.get("scenario_name", ""),
        "source": _source_text(clean) if source else "",
        "map": ", ".join(f"{key} {value}" for key, value in sources.items()),
        "map's SHA-256": about.get("map_sha256", ""),
        "seed": about.get("seed", ""),
    }
    if place.origin is not None:
        origin = place.origin
        facts["origin"] = f"{origin.latitude_deg}° N, {origin.longitude_deg}° E, {origin.altitude_m} m"
    versions = about.fields.versions
    facts["versions"] = ", ".join(f"{package} {number}" for package, number in versions.items() if number)
    return {key: value for key, value in facts.items() if value} or {
        "recorded by": "another tool than advpipe"
    }


def _source_text(clean: BagFacts) -> str:
    """The form, the name and the licence of an imported drive's source."""
    source = read_source(clean.path)
    if source is None:
        return ""
    labels = f", {source.labels}" if source.labels else ""
    return f"{source.form}, {source.name}, {source.licence or 'licence not stated'}{labels}"


def _attack(bag: BagFacts) -> _Attack:
    about = bag.provenance
    recipe = about.get("recipe", "")
    title = about.get("attack", "unknown") + (f", recipe {recipe}" if recipe else "")
    parameters = ", ".join(f"{key} {json.dumps(value)}" for key, value in about.parameters.items())
    aim = "; ".join(_aims(bag))
    return _Attack(bag.path.name, title, parameters, aim, about.get("seed", ""), about.get("frames", ""))


def _aims(bag: BagFacts) -> Iterator[str]:
    """For each attack in a bag: its attackers, victim, detector and schedule."""
    attacks = bag.provenance.fields.attacks
    for attack in attacks:
        facts = {f"attackers' {key}": value for key, value in (attack.attackers or {}).items()}
        facts |= {"victim": attack.victim, "lidar": attack.lidar, "detector": attack.detector}
        facts |= attack.schedule or {}
        stated = [f"{key} {_plain(value)}" for key, value in facts.items() if value not in (None, "", [])]
        yield (f"{attack.type}: " if len(attacks) > 1 else "") + ", ".join(stated)


def _plain(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _contents(
    found: Layout, bags: Sequence[BagFacts], pictures: Sequence[SharedPicture]
) -> Iterator[dict[str, str]]:
    for bag in bags:
        what = _WHAT.get(bag.path.name) or (_ATTACK if bag.is_attack else _DRIVE)
        yield {"name": bag.path.name, "link": bag.path.name, "size": f"{bag.description.bytes / 1e6:.1f} MB",
               "what": what}  # fmt: skip
    if found.scenario is not None:
        yield {"name": "scenario.yaml", "link": "scenario.yaml", "size": "", "what": _WHAT["scenario.yaml"]}
    if found.source is not None:
        yield {"name": "source.yaml", "link": "source.yaml", "size": "", "what": _WHAT["source.yaml"]}
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


def _chain(attacks: Sequence[BagFacts], drives: Mapping[str, BagFacts]) -> Markdown:
    """Which adversarial bags were made from which drive; run.py has rejected those with another parent."""
    lines = []
    for sha256, drive in drives.items():
        tied = [code(bag.path.name) for bag in attacks if bag.provenance.fields.parent_sha256 == sha256]
        if tied:
            place = code(drive.path.name)
            lines.append(
                f"the records of {', '.join(tied)} name the SHA-256 of {place}, from which they were made"
            )
    return Markdown(f"Provenance: {'; '.join(lines)}." if lines else "")


def _rate(topic: TopicFacts) -> str:
    if topic.count == 1:
        return "once"
    return f"{topic.rate_hz:.1f} Hz" if topic.rate_hz else ""


def _numpy_fields(clean: BagFacts, topic: TopicFacts) -> Markdown:
    """The structured type of a cloud topic's points as Python text; empty for another topic."""
    if topic.type != CLOUD_TYPE:
        return Markdown("")
    _, message = next(BagReader(clean.path, debug=True).messages(topic.name))
    fields = message.fields
    if any(field.datatype not in _POINT_TYPES for field in fields):
        return Markdown("")
    parts = {
        "names": [field.name for field in fields],
        "formats": [_POINT_TYPES[field.datatype] for field in fields],
        "offsets": [int(field.offset) for field in fields],
        "itemsize": int(message.point_step),
    }
    return Markdown(f"np.dtype({parts!a})")


def _authors_notes(found: Layout) -> Markdown:
    """The author's text in the data set's README.md, unless sharing generated that file."""
    text = found.card.read_text(encoding="utf-8", errors="replace") if found.card else ""
    return authors_text("" if names.CARD_MARK in text else text.strip())
