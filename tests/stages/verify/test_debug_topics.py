"""Debug topics that show viewers something else than the labels state."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.debug import TOUCHED_POINT_DTYPE, is_debug
from advpipe.pipeline.messages.types import serialise
from advpipe.stages.verify.checks.debug_topics import DebugTopics
from advpipe.stages.verify.result import Fault
from advpipe.stages.verify.subject import find_subject

BAGS = ("detach", "perturb", "attach", "cam", "delay", "dos", "gnss")
Tamper = Callable[[BagReader, list[RawMessage]], list[RawMessage]]


def faults(bag: Path) -> list[str]:
    (subject,) = find_subject(bag).bags
    return [found.what for found in DebugTopics(subject).check() if isinstance(found, Fault)]


def tampered(bag: Path, tamper: Tamper) -> list[str]:
    """What is found after the debug messages were exchanged."""
    reader = BagReader(bag, debug=True)
    everything = list(reader.raw_messages())
    debug = [raw for raw in everything if is_debug(raw.topic.name)]
    others = [raw for raw in everything if not is_debug(raw.topic.name)]
    assert len(debug) > 1
    beside = [path for path in bag.iterdir() if path.suffix != ".mcap" and path.name != METADATA_NAME]
    with BagWriter(bag, provenance=reader.provenance, overwrite=True) as writer:
        for path in beside:
            shutil.copy(path, writer.folder)
        for raw in sorted([*others, *tamper(reader, debug)], key=lambda each: each.log_time_ns):
            writer.copy(raw)
    return faults(bag)


def without_the_first(reader: BagReader, debug: list[RawMessage]) -> list[RawMessage]:
    return debug[1:]


def without_the_last(reader: BagReader, debug: list[RawMessage]) -> list[RawMessage]:
    return debug[:-1]


def one_more(reader: BagReader, debug: list[RawMessage]) -> list[RawMessage]:
    return [*debug, replace(debug[-1], log_time_ns=debug[-1].log_time_ns + 1)]


def of_another_time(reader: BagReader, debug: list[RawMessage]) -> list[RawMessage]:
    return [replace(debug[0], cdr=debug[-1].cdr), *debug[1:]]


def of_nothing(reader: BagReader, debug: list[RawMessage]) -> list[RawMessage]:
    topic = replace(debug[0].topic, name="/advpipe/debug/other")
    return [*debug, *(replace(raw, topic=topic) for raw in debug)]


def moved(reader: BagReader, debug: list[RawMessage]) -> list[RawMessage]:
    """One point or marker lies 5 cm elsewhere."""
    first, *rest = debug
    if first.topic.type.endswith("PointCloud2"):
        cdr = bytearray(first.cdr)
        points = np.frombuffer(cdr, TOUCHED_POINT_DTYPE, 1, len(cdr) - 1 - TOUCHED_POINT_DTYPE.itemsize)
        points["x"] += np.float32(0.05)
        return [replace(first, cdr=bytes(cdr)), *rest]
    message = reader.decode(first)
    message.markers[0].pose.position.y += 0.05
    return [replace(first, cdr=serialise(message, first.topic.type)), *rest]


@pytest.mark.parametrize("name", BAGS)
def test_what_attacks_write_is_in_order(data_set, name):
    assert any(map(is_debug, BagReader(data_set / name, debug=True).topics))
    assert faults(data_set / name) == []


@pytest.mark.parametrize("name", ["attach", "cam", "delay", "gnss"])
@pytest.mark.parametrize(
    "tamper", [without_the_first, without_the_last, one_more, of_another_time, of_nothing, moved]
)
def test_a_tampered_debug_topic_is_found(data_set, name, tamper):
    found = tampered(data_set / name, tamper)
    assert found


def test_a_bag_without_debug_topics_is_in_order(data_set):
    assert tampered(data_set / "cam", lambda reader, debug: []) == []
