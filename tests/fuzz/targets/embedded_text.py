"""JSON, YAML and GeoJSON in bags and beside them: the scenario, statistics, buildings, provenance, QoS."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml
from hypothesis import strategies as st

from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.types import serialise, typestore
from tests.fuzz import base, calls
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.targets.bag_edit import BagDocument, mcap_bytes
from tests.fuzz.values import JSON_RAWS, TEXTS, YAML_RAWS, document, edited_trees

TOPICS = ("/scenario/info", "/v2x/statistics", "/v2x/buildings")
BAGS = ("clean", "cam", "gnss", "detach")
FILES = (
    "scenario.yaml",
    *(f"{bag}/metadata.yaml" for bag in BAGS),
    *(f"{bag}/attack.yaml" for bag in BAGS[1:]),
)
STRING = "std_msgs/msg/String"


def _of(bag: str, call: Call) -> Call:
    return lambda tree, out: call(tree / bag, out)


def _each(call: Call) -> Call:
    def every(tree: Path, out: Path) -> object:
        shown = [call(tree / bag, out) for bag in BAGS]
        return "\n".join(str(text) for text in shown if text is not None)

    return every


def campaign(tree: Path, out: Path) -> None:
    """The checks of `run` on an existing data set."""
    from advpipe.pipeline.campaigns.run import has_drive, is_made_by
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.pipeline.scenario.attacks import attack_spec
    from advpipe.stages.attack.run import AttackRequest

    has_drive(tree, load_scenario("smoke", base.SETTINGS), overwrite=True)
    is_made_by(_request(AttackRequest, attack_spec), tree / "clean", tree / "cam", overwrite=False)


def _request(made: Callable[..., Any], spec: Callable[..., Any]) -> Any:
    return made((spec(base.ATTACKS["cam"]),))


CALLS: dict[str, Call] = {
    "inspect": _each(calls.inspect),
    "verify": calls.check,
    "audit": calls.audited,
    "share": calls.shared,
    "run": campaign,
    "plot": _of("clean", calls.plot),
    "recover": calls.save,
    **{name: _of("clean", calls.BAG_CALLS[name]) for name in ("replay", "cam", "gnss", "detach", "frames")},
    "export": _of("cam", calls.export),
    **{
        f"evaluate {bag}": lambda tree, out, bag=bag: calls.evaluated(tree / "clean", tree / bag, out)
        for bag in BAGS[1:]
    },
}
WEIGHTED = [name for name in CALLS for _ in range(1 if name.startswith("evaluate") or name == "share" else 4)]


READERS = {
    "/scenario/info": ["replay", "cam", "gnss", "replay", "export"],
    "/v2x/statistics": ["inspect", "inspect", "plot"],
    "/v2x/buildings": ["replay", "cam", "export"],
}
"""Which calls read a topic's text."""

WHOLE = ["run", "share", "verify", "recover", "run", "verify"]
"""Those that read a data set's own files."""


def bag_of(call: str, drawn: str) -> str:
    """The bag that a call reads, where it reads one."""
    if call in ("inspect", "verify", "audit", "share", "run", "recover"):
        return drawn
    return "cam" if call == "export" else call.partition(" ")[2] or "clean"


@dataclass(frozen=True)
class _Drive:
    """The bags of the data set, by name."""

    bags: dict[str, BagDocument]
    files: dict[str, bytes]


@st.composite
def other_texts(draw: st.DrawFn, text: str) -> tuple[str, str]:
    """A text of JSON, YAML or neither with its tree or its characters changed."""
    kind = draw(st.sampled_from(["tree"] * 6 + ["characters", "other"]))
    if kind == "characters":
        data, note = draw(edited_bytes(text.encode()))
        return data.decode(errors="replace"), note
    if kind == "other":
        raw = draw(st.sampled_from([*JSON_RAWS, *YAML_RAWS]))
        whole = draw(st.one_of(st.just(raw.text), st.sampled_from(TEXTS[:-2]))).replace("\ud800", "")
        return whole, f"all of it is {whole[:40]!r}"
    try:
        tree, raws = json.loads(text), JSON_RAWS
    except ValueError:
        tree, raws = yaml.safe_load(text), YAML_RAWS
    tree, note = draw(edited_trees(tree, raws))
    return document(tree), note


@st.composite
def message_cases(draw: st.DrawFn, drive: _Drive) -> Case:
    """Another text in a message."""
    topic = draw(st.sampled_from(TOPICS))
    call = draw(st.sampled_from([*READERS[topic] * 12, *WEIGHTED]))
    bag = bag_of(call, draw(st.sampled_from(BAGS)))
    found = drive.bags[bag]
    (place, *_), changed = found.of_topic(topic), list(found.messages)
    old = typestore().deserialize_cdr(changed[place].cdr, STRING).data
    text, note = draw(other_texts(old))
    changed[place] = replace(changed[place], cdr=serialise(build.string(text), STRING))
    return Case(call, f"{bag}/{bag}_0.mcap", mcap_bytes(changed, found.provenance), f"{topic}: {note}")


@st.composite
def provenance_cases(draw: st.DrawFn, drive: _Drive) -> Case:
    """Another record of where a bag comes from, its checksum right."""
    call = draw(st.sampled_from(WEIGHTED))
    bag = bag_of(call, draw(st.sampled_from(BAGS)))
    found = drive.bags[bag]
    key = draw(st.sampled_from(sorted(found.provenance)))
    text, note = draw(other_texts(found.provenance[key]))
    changed = {**found.provenance, key: text}
    if draw(st.integers(0, 4)) == 0:
        del changed[key]
    if draw(st.integers(0, 4)) == 0:
        other = draw(st.sampled_from(TEXTS[:-1]))
        changed[draw(st.sampled_from([*sorted(found.provenance), "\x1b[2Jkey", "recovered", "looks"]))] = (
            other
        )
    changed = {name: value.replace("\ud800", "") for name, value in changed.items()}
    return Case(call, f"{bag}/{bag}_0.mcap", mcap_bytes(found.messages, changed), f"{key}: {note}")


@st.composite
def name_cases(draw: st.DrawFn, drive: _Drive) -> Case:
    """Another name of a topic or of its type."""
    call, bag = draw(st.sampled_from(WEIGHTED)), draw(st.sampled_from(BAGS))
    found, text = drive.bags[bag], draw(st.sampled_from(TEXTS[:-1])).replace("\ud800", "")
    topic, name = draw(st.sampled_from(found.topics)), draw(st.sampled_from(["name", "type_hash"]))
    changed = [
        replace(raw, topic=replace(raw.topic, **{name: text})) if raw.topic.name == topic else raw
        for raw in found.messages
    ]
    data = mcap_bytes(changed, found.provenance)
    return Case(call, f"{bag}/{bag}_0.mcap", data, f"{name} of {topic} = {text[:40]!r}")


@st.composite
def file_cases(draw: st.DrawFn, drive: _Drive) -> Case:
    """Another YAML file beside a bag."""
    place = draw(st.sampled_from(FILES))
    call = draw(st.sampled_from(WEIGHTED if place.endswith("metadata.yaml") else WHOLE))
    if place.endswith("metadata.yaml"):
        place = f"{bag_of(call, place.partition('/')[0])}/metadata.yaml"
    if draw(st.integers(0, 4)) == 0:
        data, note = draw(edited_bytes(drive.files[place]))
    else:
        text, note = draw(other_texts(drive.files[place].decode()))
        data = text.encode(errors="surrogateescape")
    return Case(call, place, data, note)


def cases(folder: Path) -> st.SearchStrategy[Case]:
    drive = _Drive(
        {bag: BagDocument(folder / bag) for bag in BAGS},
        {place: (folder / place).read_bytes() for place in FILES},
    )
    return st.one_of(
        message_cases(drive),
        message_cases(drive),
        provenance_cases(drive),
        name_cases(drive),
        file_cases(drive),
    )


TARGET = Target("embedded_text", base.DRIVE, cases, CALLS)
