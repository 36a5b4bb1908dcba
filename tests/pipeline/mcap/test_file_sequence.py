"""The files of a bag are read in log-time order, and one is opened when its first message is due."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO, Any

import mcap.writer
import numpy as np
import pytest

from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.file_sequence import FileSequence
from advpipe.pipeline.mcap.reader import McapFile
from advpipe.pipeline.mcap.writer import McapWriter

LIBRARY = mcap.writer.Writer
BODY = b"\0\1\0\0" + bytes(8)


def file_of(path: Path, times_ns: Sequence[int], *, has_index: bool = True) -> McapFile:
    """A file with a message at each time; its body says which file it is in."""
    body = BODY + path.stem.encode()
    with path.open("wb") as stream:
        if has_index:
            ours = McapWriter(stream)
            ours.add_schema("std_msgs/msg/Empty", "ros2msg", b"")
            ours.add_channel("/a", 1, {})
            for number, time_ns in enumerate(times_ns):
                ours.add_message(1, time_ns, body, time_ns, number)
            ours.finish()
            return McapFile(path)
        theirs = LIBRARY(stream, use_chunking=False, use_summary_offsets=False, use_statistics=False)
        theirs.start("ros2", "another tool")
        theirs.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        theirs.register_channel("/a", "cdr", 1)
        for number, time_ns in enumerate(times_ns):
            theirs.add_message(1, time_ns, body, time_ns, number)
        theirs.finish()
    return McapFile(path)


def merged(files: Sequence[McapFile], first_ns: int | None, last_ns: int | None) -> list[RawMessage]:
    """What reading all files at once gives."""
    streams = [file.raw_messages(None, first_ns, last_ns) for file in files]
    return list(heapq.merge(*streams, key=lambda raw: raw.log_time_ns))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[IO[Any]]:
    """The files that were opened, in order."""
    found, really_open = list[IO[Any]](), Path.open

    def noted(path: Path, mode: str) -> IO[Any]:
        found.append(really_open(path, mode))
        return found[-1]

    monkeypatch.setattr(Path, "open", noted)
    return found


def names_of(streams: Iterable[IO[Any]]) -> list[str]:
    return [Path(stream.name).stem for stream in streams]


def test_files_one_after_another_are_opened_one_after_another(tmp_path: Path, opened: list[IO[Any]]) -> None:
    sequence = FileSequence(
        [file_of(tmp_path / f"{n}.mcap", range(10 * n, 10 * n + 10)) for n in range(1, 5)]
    )
    opened.clear()
    messages = sequence.raw_messages(None, None, None)
    assert [next(messages).log_time_ns for _ in range(11)] == [*range(10, 21)]
    assert names_of(opened) == ["1", "2"]
    assert [raw.log_time_ns for raw in messages] == [*range(21, 50)]
    opened.clear()
    assert [raw.log_time_ns for raw in sequence.raw_messages(None, 29, 31)] == [29, 30, 31]
    assert names_of(opened) == ["2", "3"]
    opened.clear()
    assert not [*sequence.raw_messages(None, 50, None), *sequence.raw_messages(None, -5, -1)]
    assert not list(sequence.raw_messages(["/b"], None, None))
    assert not opened


@pytest.mark.parametrize(("count", "most_open"), [(11, 1), (16, 2), (21, 2), (26, 3)])
def test_files_that_touch_or_overlap_are_open_only_while_they_are_read(
    tmp_path: Path, opened: list[IO[Any]], count: int, most_open: int
) -> None:
    """Every 10 ns a file begins; with 11 messages, at 1 ns each, the next one begins with its last."""
    files = [file_of(tmp_path / f"{n}.mcap", range(10 * n, 10 * n + count)) for n in range(9)]
    expected = merged(files, None, None)
    opened.clear()
    found, counts = list[RawMessage](), set[int]()
    for raw in FileSequence(files).raw_messages(None, None, None):
        found.append(raw)
        counts.add(sum(not stream.closed for stream in opened))
        assert len(opened) <= raw.log_time_ns // 10 + 1
    assert found == expected
    assert names_of(opened) == [str(n) for n in range(9)]
    assert max(counts) == most_open
    assert all(stream.closed for stream in opened)


@pytest.mark.parametrize("seed", range(20))
def test_the_order_is_that_of_all_files_read_at_once(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    files = []
    for number in range(6):
        first_ns, count = rng.integers(0, 60), rng.integers(0, 12)
        times_ns = np.sort(first_ns + rng.integers(0, 15, count)).tolist()
        files.append(file_of(tmp_path / f"{number}.mcap", times_ns, has_index=bool(rng.integers(0, 8))))
    sequence = FileSequence(files)
    for span_ns in [(None, None), (20, None), (None, 40), (17, 23), (30, 30), (70, 2)]:
        assert list(sequence.raw_messages(None, *span_ns)) == merged(files, *span_ns)


def test_times_that_no_file_can_hold_are_bounds_like_others(tmp_path: Path) -> None:
    sequence = FileSequence([file_of(tmp_path / "a.mcap", [0, 1]), file_of(tmp_path / "b.mcap", [1, 2])])
    assert [raw.log_time_ns for raw in sequence.raw_messages(None, -5, 2**64)] == [0, 1, 1, 2]
    assert not [*sequence.raw_messages(None, None, -1), *sequence.raw_messages(None, 2**64, None)]


def test_the_span_of_a_file_without_messages_holds_no_time(tmp_path: Path) -> None:
    assert file_of(tmp_path / "some.mcap", [3, 9]).span_ns == (3, 9)
    first_ns, last_ns = file_of(tmp_path / "none.mcap", []).span_ns
    assert first_ns > last_ns
    assert file_of(tmp_path / "plain.mcap", [3, 9], has_index=False).span_ns == (0, 2**64 - 1)
