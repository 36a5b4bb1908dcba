"""Regression inputs: the smallest of each type that was once not handled; each run makes them anew."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mcap.records import Channel

from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.types import serialise, typestore
from tests.fuzz import base
from tests.fuzz.case import Case
from tests.fuzz.mcap_tree import body_of, put_together, take_apart
from tests.fuzz.seed_files import database, lane_shapes, long_curves
from tests.fuzz.targets import (
    checkpoint,
    container,
    embedded_text,
    tables,
    tar,
    trajectories,
)
from tests.fuzz.targets import scenario as scenarios
from tests.fuzz.targets.bag_edit import BagDocument, mcap_bytes
from tests.fuzz.values import Raw, document

DEEP = Raw("[" * 100_000 + "]" * 100_000)
BOMB_ROWS = 30_000_000
BOMB_MESSAGES = 6_000_000
"""Rows of which each is many values: as Python's own they take more than any input may."""

Edit = Callable[[Any], Any]


@dataclass(frozen=True)
class Seed:
    """make: the case, given the folder of the base documents."""

    name: str
    target: str
    make: Callable[[Path], Case]


def _put(tree: dict[str, Any], place: str, value: Any) -> dict[str, Any]:
    """The tree with another value at `a.b.c`."""
    head, _, rest = place.partition(".")
    return {**tree, head: _put(tree[head], rest, value) if rest else value}


def _seed_of(value: Any) -> Edit:
    return lambda tree: _put(tree, "simulation.seed", value)


def _all(value: Any) -> Edit:
    return lambda tree: dict.fromkeys(tree, value)


def text_in_bag(call: str, topic: str, edit: Edit, bag: str = "clean") -> Callable[[Path], Case]:
    """A bag in which the JSON on a topic is another; `edit` takes the tree and returns one."""

    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / bag)
        changed, place = list(found.messages), found.of_topic(topic)[0]
        old = typestore().deserialize_cdr(changed[place].cdr, embedded_text.STRING).data
        text = document(edit(json.loads(old)))
        changed[place] = replace(changed[place], cdr=serialise(build.string(text), embedded_text.STRING))
        return Case(call, f"{bag}/{bag}_0.mcap", mcap_bytes(changed, found.provenance))

    return make


def provenance(call: str, key: str, text: str, bag: str = "cam") -> Callable[[Path], Case]:
    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / bag)
        data = mcap_bytes(found.messages, {**found.provenance, key: text})
        return Case(call, f"{bag}/{bag}_0.mcap", data)

    return make


def topic_name(call: str, name: str) -> Callable[[Path], Case]:
    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / "clean")
        changed = [
            replace(raw, topic=replace(raw.topic, name=name)) if raw.topic.name == "/clock" else raw
            for raw in found.messages
        ]
        return Case(call, "clean/clean_0.mcap", mcap_bytes(changed, found.provenance))

    return make


def message(call: str, topic: str, edit: Callable[[Any], None], bag: str = "clean") -> Callable[[Path], Case]:
    """A bag in which all messages of a topic are changed."""

    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / bag)
        changed = list(found.messages)
        for place in found.of_topic(topic):
            raw = changed[place]
            message = typestore().deserialize_cdr(raw.cdr, raw.topic.type)
            edit(message)
            changed[place] = replace(raw, cdr=serialise(message, raw.topic.type))
        return Case(call, f"{bag}_0.mcap", mcap_bytes(changed, found.provenance))

    return make


def twice(call: str, topic: str) -> Callable[[Path], Case]:
    """A bag in which each message of a topic comes twice."""

    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / "clean")
        changed = [raw for raw in found.messages for _ in range(1 + (raw.topic.name == topic))]
        return Case(call, "clean_0.mcap", mcap_bytes(changed, found.provenance))

    return make


def at_another_time(call: str, topic: str, time_ns: int) -> Callable[[Path], Case]:
    """A bag in which the first message of a topic has another log time."""

    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / "clean")
        changed, place = list(found.messages), found.of_topic(topic)[0]
        changed[place] = replace(changed[place], log_time_ns=time_ns)
        changed.sort(key=lambda raw: raw.log_time_ns)
        return Case(call, "clean_0.mcap", mcap_bytes(changed, found.provenance))

    return make


def begun_at(call: str, time_ns: int) -> Callable[[Path], Case]:
    """A bag with log times from then on."""

    def make(folder: Path) -> Case:
        found = BagDocument(folder / base.DRIVE / "clean")
        shift_ns = time_ns - min(raw.log_time_ns for raw in found.messages)
        changed = [replace(raw, log_time_ns=raw.log_time_ns + shift_ns) for raw in found.messages]
        return Case(call, "clean_0.mcap", mcap_bytes(changed, found.provenance))

    return make


def no_turn(message: Any) -> None:
    """Quaternions of length zero."""
    for station in message.stations:
        for name in "xyzw":
            object.__setattr__(station.pose.orientation, name, 0.0)


def no_place(message: Any) -> None:
    """Positions that are NaN."""
    for station in message.stations:
        object.__setattr__(station.pose.position, "x", float("nan"))


def of_a_stranger(message: Any) -> None:
    """A sender that no list of stations contains."""
    object.__setattr__(message, "station_id", 0)


def yaml_file(value: str, place: str = "attacks") -> Callable[[Path], Case]:
    attack = "{laughs: [{type: detach, parameters: {ratio: %s}}]}" if place == "attacks" else "%s"
    text = f"name: a\nmap: {{sumo_net: boulevard.net.xml}}\n{place}: {attack % value}\n"
    return lambda folder: Case("load", scenarios.FILE, text.encode())


def setting(call: str, *settings: str) -> Callable[[Path], Case]:
    return lambda folder: Case(call, scenarios.SETTINGS, json.dumps(settings).encode())


def parquet_bomb(call: str, place: str, rows: int = BOMB_ROWS) -> Callable[[Path], Case]:
    """A table of millions of equal rows."""

    def make(folder: Path) -> Case:
        data = (folder / base.DRIVE / place).read_bytes()
        return Case(call, place, tables.bomb(data, rows))

    return make


def group_of_other_names(call: str, place: str, column: bytes) -> Callable[[Path], Case]:
    """A table whose last row group has a column name that is not UTF-8."""

    def make(folder: Path) -> Case:
        before, found, after = (folder / base.DRIVE / place).read_bytes().rpartition(b"\x19\x18" + column)
        return Case(call, place, before + found[:-1] + b"\xf3" + after)

    return make


def trajectory_bomb(folder: Path) -> Case:
    data = (folder / base.TABLES / trajectories.PARQUET).read_bytes()
    return Case("parquet", trajectories.PARQUET, tables.repeated(tables.read(data), BOMB_ROWS))


def zip_bomb(folder: Path) -> Case:
    """A checkpoint of ten megabytes that unpacks to more than two gigabytes."""
    import zipfile

    with zipfile.ZipFile(folder / base.WEIGHTS / checkpoint.THEIRS) as file:
        entries = {name: file.read(name) for name in file.namelist()}
    largest = next(name for name in entries if name.endswith("/data/0"))
    return Case("import", checkpoint.THEIRS, checkpoint.torch_file(entries, largest, 9 << 28))


def checkpoint_about(edit: Edit) -> Callable[[Path], Case]:
    """An advpipe checkpoint with other metadata."""

    def make(folder: Path) -> Case:
        data = (folder / base.WEIGHTS / checkpoint.OURS).read_bytes()
        (length,) = struct.unpack_from("<Q", data)
        header, tensors = json.loads(data[8 : 8 + length]), data[8 + length :]
        about = edit(json.loads(header["__metadata__"]["advpipe"]))
        header["__metadata__"]["advpipe"] = document(about)
        return Case("load", checkpoint.OURS, checkpoint.safetensors(header, tensors))

    return make


def cut_npy(folder: Path) -> Case:
    """An array whose header ends within a bracket."""
    data = (folder / base.POINTS / "clouds" / "named.npy").read_bytes()
    head = b"{'descr': [('x', '<f4'), ("
    return Case("file", "clouds/named.npy", data[:8] + struct.pack("<H", len(head)) + head)


def long_word(folder: Path) -> Case:
    """Poses of which one number is a long word."""
    return Case("folder", "drive/poses.txt", b"x" * 100_000 + b" 0 0 0 0 1 0 0 0 0 1 0\n")


def bad_qos(folder: Path) -> Case:
    """A bag whose summary has a quality of service that is not YAML."""
    nodes = take_apart((folder / base.DRIVE / "clean" / container.MCAP).read_bytes())
    for node in nodes:
        if isinstance(channel := node.value(), Channel):
            channel.metadata["offered_qos_profiles"] = "\0"
            node.body = body_of(channel)
    return Case("recover", container.MCAP, put_together(nodes))


def far_summary(folder: Path) -> Case:
    """A bag whose footer has the summary begin exabytes behind its end."""
    data = (folder / base.DRIVE / "clean" / container.MCAP).read_bytes()
    return Case("recover", container.MCAP, data[:-28] + struct.pack("<Q", (1 << 63) - 1) + data[-20:])


def long_name(folder: Path) -> Case:
    """An archive, good but for a file whose name no file system takes."""
    return Case("unpack", tar.ARCHIVE, tar.archive({"n" * 300: b""}))


def laughs(levels: int = 9) -> str:
    """A page of YAML that stands for 9**levels values."""
    lines = ["&a0 [" + ",".join(["lol"] * 9) + "]"]
    lines += [f"&a{n} [{','.join([f'*a{n - 1}'] * 9)}]" for n in range(1, levels)]
    return f"[{','.join(lines)}]"


INFO, STATISTICS, BUILDINGS = embedded_text.TOPICS
EMBEDDED, CDR = "embedded_text", "cdr"
MESSAGES = "cam/v2x_labels.parquet"
SEEDS = (
    Seed("deep scenario, replay", EMBEDDED, text_in_bag("replay", INFO, lambda tree: DEEP)),
    Seed("deep scenario, cam", EMBEDDED, text_in_bag("cam", INFO, lambda tree: DEEP)),
    Seed("deep scenario, gnss", EMBEDDED, text_in_bag("gnss", INFO, lambda tree: DEEP)),
    Seed("infinite seed", EMBEDDED, text_in_bag("cam", INFO, _seed_of(Raw("1e999")))),
    Seed("negative seed", EMBEDDED, text_in_bag("cam", INFO, _seed_of(-5))),
    Seed("deep statistics", EMBEDDED, text_in_bag("inspect", STATISTICS, lambda tree: DEEP)),
    Seed("statistics of no kind, inspect", EMBEDDED, text_in_bag("inspect", STATISTICS, _all("x"))),
    Seed("statistics of no kind, plot", EMBEDDED, text_in_bag("plot", STATISTICS, _all(None))),
    Seed("deep buildings", EMBEDDED, text_in_bag("replay", BUILDINGS, lambda tree: DEEP)),
    Seed("buildings of no kind", EMBEDDED, text_in_bag("replay", BUILDINGS, lambda tree: {"type": "Point"})),
    Seed("deep parameters", EMBEDDED, provenance("share", "parameters", DEEP.text)),
    Seed("parameters of no kind", EMBEDDED, provenance("share", "parameters", "[1]")),
    Seed("escape in a topic's name", EMBEDDED, topic_name("inspect", "/\x1b[31mred")),
    Seed("escape in provenance", EMBEDDED, provenance("inspect", "scenario_name", "\x1b]0;title\x07")),
    Seed("script in provenance", EMBEDDED, provenance("share", "attack", "<script>alert(1)</script>")),
    Seed("mathtext in a name", EMBEDDED, provenance("plot", "scenario_name", "a$_{$b", "clean")),
    Seed("no rotation, replay", CDR, message("replay", "/v2x/stations", no_turn)),
    Seed("no rotation, export", CDR, message("export", "/v2x/stations", no_turn)),
    Seed("no rotation, cam", CDR, message("cam", "/v2x/stations", no_turn)),
    Seed("position of no number, cam", CDR, message("cam", "/v2x/stations", no_place)),
    Seed("position of no number, export", CDR, message("export", "/v2x/stations", no_place)),
    Seed("a stranger's message, cam", CDR, message("cam", "/v2x/sent", of_a_stranger)),
    Seed("a stranger's message, export", CDR, message("export", "/v2x/sent", of_a_stranger)),
    Seed("estimates twice, gnss", CDR, twice("gnss", "/ego/odometry")),
    Seed("sent twice, export", CDR, twice("export", "/v2x/sent")),
    Seed("stations twice, export", CDR, twice("export", "/v2x/stations")),
    Seed("stations since 1970, sybil", CDR, at_another_time("sybil", "/v2x/stations", 1)),
    Seed("estimates since 1970, gnss", CDR, at_another_time("gnss", "/ego/odometry", 1)),
    Seed("estimates until 2116, gnss", CDR, at_another_time("gnss", "/ego/odometry", 1 << 62)),
    Seed("drive in 1970, export", CDR, begun_at("export", 0)),
    Seed("drive in 2116, cam", CDR, begun_at("cam", 1 << 62)),
    Seed("aliases in a scenario", "scenario", yaml_file(laughs())),
    Seed("tag of another kind", "scenario", yaml_file("!!bool x", "description")),
    Seed("timestamp of no time", "scenario", yaml_file("!!timestamp x", "description")),
    Seed("tag in a setting", "scenario", setting("override", "simulation.seed=!!bool x")),
    Seed("alias of itself", "scenario", setting("attack", "rate_hz=&a [*a]")),
    Seed("tag in a parameter", "scenario", setting("attack", "rate_hz=!!int ''")),
    Seed("many trajectories", "trajectories", trajectory_bomb),
    Seed("many messages, verify", "parquet", parquet_bomb("verify cam", MESSAGES, BOMB_MESSAGES)),
    Seed("many messages, export", "parquet", parquet_bomb("export cam", MESSAGES, BOMB_MESSAGES)),
    Seed("many points, verify", "parquet", parquet_bomb("verify detach", "detach/labels.parquet")),
    Seed(
        "group of other names, export",
        "parquet",
        group_of_other_names("export gnss", "gnss/v2x_labels.parquet", b"\x06number"),
    ),
    Seed("QoS of no kind, recover", "container", bad_qos),
    Seed("summary beyond all files, recover", "container", far_summary),
    Seed("name of 300 letters", "tar", long_name),
    Seed("zip of zeros", "checkpoint", zip_bomb),
    Seed("checkpoint of a deep text", "checkpoint", checkpoint_about(lambda about: DEEP)),
    Seed("checkpoint of a list", "checkpoint", checkpoint_about(lambda about: [about])),
    Seed("header of half an array", "point_files", cut_npy),
    Seed("number of 100,000 letters", "point_files", long_word),
    Seed("time of a word", "recording", database("timestamp = ?", "soon")),
    Seed("message of a number", "recording", database("data = ?", 0.5)),
    Seed("lane beyond all numbers", "network", lane_shapes("simulate", "1e308,0 -1e308,0")),
    Seed("curves beyond all maps", "network", long_curves),
    Seed("lane with and without height", "network", lane_shapes("repair", "0,0,1 50,0")),
)  # fmt: skip
