"""Chunks that were read shortly before are not unpacked again, and memory stays bounded."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap import recent_chunks
from advpipe.pipeline.mcap.recent_chunks import RecentChunks, UnpackedChunk
from advpipe.pipeline.mcap.unpacking import UnpackBudget
from advpipe.pipeline.messages.build import clock, string
from advpipe.pipeline.messages.topics import CLOCK, SCENARIO_INFO


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag", provenance={}) as writer:
        writer.write(SCENARIO_INFO, string("x"), 1)
        for time_ns in range(1, 200):
            writer.write(CLOCK, clock(time_ns), time_ns)
    return tmp_path / "bag"


def test_messages_of_one_chunk_are_read_one_by_one_with_one_unpacking(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unpacked, unpack = [], UnpackBudget.unpack
    monkeypatch.setattr(UnpackBudget, "unpack", lambda *given: unpacked.append(1) or unpack(*given))
    reader = BagReader(bag)
    for time_ns in (*range(1, 200), 5):
        (one,) = reader.raw_messages([CLOCK.name], time_ns, time_ns)
        assert one.log_time_ns == time_ns
    assert len(unpacked) == 1
    assert len(list(reader.raw_messages())) == 200


def test_a_changed_bag_in_the_same_place_is_read_anew(bag: Path) -> None:
    assert len(list(BagReader(bag).raw_messages([CLOCK.name], 7, 7))) == 1
    with BagWriter(bag, provenance={}, overwrite=True) as writer:
        writer.write(CLOCK, clock(3), 7)
    (one,) = BagReader(bag).raw_messages()
    assert one.cdr[4:12] == (0).to_bytes(4, "little") + (3).to_bytes(4, "little")


def test_the_chunks_used_longest_ago_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recent_chunks, "KEPT_BYTES", 250)
    kept, file = RecentChunks(), object()
    chunks = [UnpackedChunk(100, 0, {}) for _ in range(3)]
    kept.keep(file, 0, chunks[0])
    kept.keep(file, 1, chunks[1])
    assert kept.find(file, 0) is chunks[0]
    kept.keep(file, 2, chunks[2])
    assert [kept.find(file, start) is not None for start in range(3)] == [True, False, True]
    assert kept.find(object(), 0) is None
