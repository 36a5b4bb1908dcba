"""What to do to messages of a drive, field by field, and a bag with messages changed like that.

As a program, it goes through all of them with all commands: DATA_SET [FIRST [LAST]].
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from typer.testing import CliRunner

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.types import serialise

V2X = ("/v2x/sent", "/v2x/stations")
SENSED = (
    *("/ego/gnss/fix", "/ego/odometry", "/ego/ground_truth/odometry", "/ego/imu", "/ego/initialpose"),
    *(
        "/ego/wheel/odometry",
        "/tf",
        "/tf_static",
        "/ego/ground_truth/objects",
        "/ego/ground_truth/road_users",
    ),
    *("/ego/ldm", "/ego/ldm/objects"),
)
SMALL = (
    *("simulation.duration_s=0.6", "simulation.warmup_s=5", "traffic.vehicles=12", "traffic.pedestrians=2"),
    *("sensors.lidars.lidar.channels=4", "sensors.lidars.lidar.points_per_second=4000"),
)
"""A scenario's overrides: half a second, a few vehicles, a few points."""
FLOATS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e30, 0.0)
TEXTS = ("", "a\0b", "x" * 1_000_000, "$\\foo$", "<script>alert(1)</script>", "\x1b[31m", "../../etc")


class Mutation(NamedTuple):
    """What is done to the messages of a topic."""

    topic: str
    name: str
    edit: Callable[[list[RawMessage], BagReader], Iterable[RawMessage]]


def mutations_of(reader: BagReader, topic: str) -> Iterator[Mutation]:
    """Each field of the message in the middle with odd values; and what can become of messages as a whole."""
    raws = list(reader.raw_messages([topic]))
    raw = raws[len(raws) // 2]
    for place, value in _leaves(reader.decode_as_it_is(raw)):
        for odd in _odd(value):
            shown = f"{odd!r}"[:20]
            yield Mutation(topic, f"{'.'.join(map(str, place))}={shown}", _field(place, odd))
    yield from (Mutation(topic, name, edit) for name, edit in WHOLE.items())


def _leaves(value: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Of lists the first item, and the list itself."""
    if is_dataclass(value):
        for field in fields(value):
            if not field.name.startswith("__"):
                yield from _leaves(getattr(value, field.name), (*place, field.name))
    elif isinstance(value, list):
        yield place, value
        if value:
            yield from _leaves(value[0], (*place, 0))
    else:
        yield place, value


def _odd(value: Any) -> Iterator[Any]:
    if isinstance(value, float | np.floating):
        yield from FLOATS
    elif isinstance(value, bool):
        yield not value
    elif isinstance(value, int | np.integer):
        yield from (0, 1, 127)
    elif isinstance(value, str):
        yield from TEXTS
    elif isinstance(value, list):
        yield from ([], value * 2)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        yield from (np.full_like(value, odd) for odd in FLOATS)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "u":
        yield from (value[:0], np.zeros(100_000, value.dtype), value[::-1].copy())


def _field(place: tuple[str | int, ...], odd: Any) -> Any:
    def edit(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
        middle = len(raws) // 2
        for number, raw in enumerate(raws):
            if number == middle:
                message = reader.decode_as_it_is(raw)
                _set(message, place, odd)
                yield replace(raw, cdr=serialise(message, raw.topic.type))
            else:
                yield raw

    return edit


def _set(message: Any, place: tuple[str | int, ...], odd: Any) -> None:
    for step in place[:-1]:
        message = message[step] if isinstance(step, int) else getattr(message, step)
    object.__setattr__(message, str(place[-1]), odd)


def _twice(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    for raw in raws:
        yield from (raw, raw)


def _shifted(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    """The contents of each message, at the time of the one after it."""
    for before, raw in zip(raws, [*raws[1:], raws[0]], strict=True):
        yield replace(raw, cdr=before.cdr)


def _without_half(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    yield from raws[: len(raws) // 2]


def _none(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    yield from ()


def _backwards(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    for raw, other in zip(raws, reversed(raws), strict=True):
        yield replace(raw, cdr=other.cdr)


def _cut(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    for raw in raws:
        yield replace(raw, cdr=raw.cdr[: len(raw.cdr) // 2])


def _alike(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    """All are copies of the first one."""
    for raw in raws:
        yield replace(raw, cdr=raws[0].cdr)


def _no_rotation(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    for raw in raws:
        message = reader.decode_as_it_is(raw)
        for place, value in list(_leaves(message)):
            if len(place) > 1 and place[-2] in ("orientation", "rotation") and isinstance(value, float):
                _set(message, place, 0.0)
        yield replace(raw, cdr=serialise(message, raw.topic.type))


def _unknown_ids(raws: list[RawMessage], reader: BagReader) -> Iterator[RawMessage]:
    for number, raw in enumerate(raws):
        message = reader.decode_as_it_is(raw)
        for place, _ in list(_leaves(message)):
            if place[-1] == "station_id":
                _set(message, place, 4_000_000_000 + number)
        yield replace(raw, cdr=serialise(message, raw.topic.type))


WHOLE = {
    "twice": _twice, "shifted": _shifted, "without half": _without_half, "none": _none, "cut": _cut,
    "backwards": _backwards, "alike": _alike, "no rotation": _no_rotation, "unknown ids": _unknown_ids,
}  # fmt: skip


def write_mutated(source: Path, out: Path, mutation: Mutation) -> None:
    """The bag with these messages instead, whole in itself."""
    reader = BagReader(source)
    old = list(reader.raw_messages([mutation.topic]))
    new = list(mutation.edit(old, reader))
    others = [raw for raw in reader.raw_messages() if raw.topic.name != mutation.topic]
    with BagWriter(out, provenance=reader.provenance) as writer:
        for raw in sorted((*others, *new), key=lambda raw: raw.log_time_ns):
            writer.copy(raw)


def write_text(source: Path, out: Path, topic: str, text: str) -> None:
    """The bag with another text on a topic of texts, which it need not have."""
    from advpipe.pipeline.messages import build, topics

    reader = BagReader(source)
    raws = [raw for raw in reader.raw_messages() if raw.topic.name != topic]
    known = {one.name: one for one in (topics.SCENARIO_INFO, topics.V2X_BUILDINGS, topics.V2X_STATISTICS)}
    with BagWriter(out, provenance=reader.provenance) as writer:
        writer.write(known[topic], build.string(text), raws[0].log_time_ns)
        for raw in raws:
            writer.copy(raw)


def write_record(source: Path, out: Path, record: dict[str, str]) -> None:
    """The bag with other words in its own record, whatever they are."""
    reader = BagReader(source)
    writer = BagWriter(out, provenance={})
    writer._provenance = {**reader.provenance, **record}  # type: ignore[assignment]
    with writer:
        for raw in reader.raw_messages():
            writer.copy(raw)


COMMANDS: dict[str, tuple[str, ...]] = {
    "inspect": ("inspect", "{bag}", "--json"),
    "plot": ("plot", "{bag}", "-o", "{out}/v2x.svg"),
    "verify": ("verify", "{bag}"),
    "export": ("export", "{bag}", "-o", "{out}/veremi"),
    "cam": ("attack", "{bag}", "--type", "cam-position-offset", "--attacker", "50%", "--out", "{out}/cam"),
    "gnss": ("attack", "{bag}", "--type", "gnss-bias", "--victim", "ego", "--out", "{out}/gnss"),
    "evaluate": ("evaluate", "{clean}", "{bag}", "--out", "{out}/report"),
    "evaluate alone": ("evaluate", "{bag}", "--frames", ":2", "--out", "{out}/alone"),
    "recover": ("recover", "{bag}", "-o", "{out}/recovered"),
    "share": ("share", "{set}", "-o", "{out}/shared"),
}


def failures(
    clean: Path, bag: Path, commands: Iterable[str] = tuple(COMMANDS), scenario: Path | None = None
) -> list[str]:
    """What ends with a traceback, or with an error of more than one line, of all commands on a bag."""
    from advpipe.pipeline.cli import app

    found = []
    with tempfile.TemporaryDirectory() as scratch:
        dataset = Path(scratch) / "set"
        dataset.mkdir()
        (dataset / "clean").symlink_to(bag.resolve())
        if "share" in commands:
            (dataset / "clean").unlink()
            shutil.copytree(bag, dataset / "clean")
        for name in commands:
            places = {"bag": bag, "out": scratch, "clean": clean, "set": dataset}
            arguments = [argument.format(**places) for argument in COMMANDS[name]]
            result = CliRunner().invoke(app, arguments)
            if result.exception is not None and not isinstance(result.exception, SystemExit):
                trace = "".join(traceback.format_exception(result.exception)).splitlines()
                files = " <- ".join(line.strip() for line in trace[-8:-1] if "File" in line)
                found.append(f"{name}: {trace[-1][:200]} | {files}")
            elif result.exit_code:
                lines = [line for line in result.stderr.splitlines() if line.startswith("advpipe: ")]
                if name != "verify" and len(lines) != 1:
                    found.append(f"{name}: exit {result.exit_code}: {result.stderr[-300:]!r}")
                elif any(len(line) > 1500 for line in lines):
                    found.append(f"{name}: a line of {max(map(len, lines))} characters")
    return found


def main() -> None:
    clean = Path(sys.argv[1])
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    last = int(sys.argv[3]) if len(sys.argv) > 3 else 10**9
    reader, number, bad = BagReader(clean), 0, 0
    for topic in (*V2X, *SENSED):
        for mutation in mutations_of(reader, topic):
            number += 1
            if not first <= number < last:
                continue
            with tempfile.TemporaryDirectory() as scratch:
                bag = Path(scratch) / "bag"
                try:
                    write_mutated(clean, bag, mutation)
                except Exception as error:
                    print(
                        number, mutation.topic, mutation.name, "not written:", repr(error)[:100], flush=True
                    )
                    continue
                for line in failures(clean, bag):
                    bad += 1
                    print(number, mutation.topic, mutation.name, line, flush=True)
    print(json.dumps({"mutations": number, "failures": bad}))


if __name__ == "__main__":
    main()
