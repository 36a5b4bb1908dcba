"""A bag of several files: rosbags and mcap read it, and we read it like the same bag in one file."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.part import BagSplit
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.stages.verify.run import verify

Record = Callable[..., Path]

STEP_NS = 100_000_000
BY_TIME = BagSplit(after_s=0.2)


def files_of(bag: Path) -> list[str]:
    return sorted(path.name for path in bag.glob("*.mcap"))


@pytest.mark.oracle
def test_rosbags_reads_it_like_the_same_bag_in_one_file(tmp_path: Path, record: Record) -> None:
    found = []
    for name, split in (("whole", None), ("split", BY_TIME)):
        bag = record(tmp_path / name, frames=6, split=split)
        with AnyReader([bag]) as reader:
            found.append([(each.topic, stamp_ns, bytes(cdr)) for each, stamp_ns, cdr in reader.messages()])
            assert reader.message_count == len(found[-1])
    assert sorted(found[0]) == sorted(found[1])
    assert files_of(tmp_path / "split") == [f"split_{number}.mcap" for number in range(3)]


@pytest.mark.oracle
def test_the_mcap_library_reads_each_file_and_metadata_states_what_is_in_it(
    tmp_path: Path, record: Record
) -> None:
    bag = record(tmp_path / "bag", frames=5, split=BY_TIME)
    stated = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert stated["relative_file_paths"] == [entry["path"] for entry in stated["files"]] == files_of(bag)
    total = 0
    for entry in stated["files"]:
        with (bag / entry["path"]).open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            times_ns = [message.log_time for _, _, message in reader.iter_messages()]
            assert {record.name for record in reader.iter_metadata()} == {"advpipe", "rosbag2"}
        assert entry["message_count"] == len(times_ns)
        assert entry["starting_time"]["nanoseconds_since_epoch"] == min(times_ns)
        assert entry["duration"]["nanoseconds"] == max(times_ns) - min(times_ns) <= STEP_NS
        total += len(times_ns)
    assert (
        stated["message_count"]
        == total
        == sum(topic["message_count"] for topic in stated["topics_with_message_count"])
    )
    assert stated["duration"]["nanoseconds"] == 4 * STEP_NS


def test_verify_finds_what_it_finds_in_one_file(tmp_path: Path, record: Record) -> None:
    """What the drive of the fixture lacks of its truth; nothing of files, metadata, counts or times."""
    found = [
        [(each.check, each.what) for each in verify(record(tmp_path / name, frames=5, split=split)).findings]
        for name, split in (("whole", None), ("split", BY_TIME))
    ]
    assert found[0] == found[1]
    assert {check for check, _ in found[1]} == {"boxes", "transforms"}


def test_we_read_the_same_frames(tmp_path: Path, record: Record) -> None:
    whole, split = record(tmp_path / "whole", frames=6), record(tmp_path / "split", frames=6, split=BY_TIME)
    assert BagReader(split).topics == BagReader(whole).topics
    assert BagReader(split).provenance == BagReader(whole).provenance
    for one, other in zip(read_frames(whole), read_frames(split), strict=True):
        assert (one.index, one.stamp_ns, one.cloud.tobytes()) == (
            other.index,
            other.stamp_ns,
            other.cloud.tobytes(),
        )
        assert (one.boxes.geometry == other.boxes.geometry).all()


def test_a_frame_is_read_from_its_own_file_alone(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag", frames=6, split=BY_TIME, compression="none")
    other = bag / "bag_1.mcap"
    with other.open("rb") as stream:
        (chunk,) = make_reader(stream).get_summary().chunk_indexes
    content = bytearray(other.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 0xFF
    other.write_bytes(content)
    (frame,) = read_frames(bag, FrameSlice(4, 5))
    assert frame.index == 4
    with pytest.raises(AdvpipeError, match=r"bag_1\.mcap: damaged"):
        list(read_frames(bag, FrameSlice(2, 3)))


def test_limits(tmp_path: Path, record: Record) -> None:
    """By bytes before compression: a message that exceeds the limit alone has a file of its own."""
    one = record(tmp_path / "a" / "bag", frames=4, split=BagSplit(after_mb=0.004))
    again = record(tmp_path / "b" / "bag", frames=4, split=BagSplit(after_mb=0.004))
    assert len(files_of(one)) > 2
    for name in files_of(one):
        assert (one / name).read_bytes() == (again / name).read_bytes()
    tiny = record(tmp_path / "c" / "bag", frames=1, split=BagSplit(after_mb=1e-9))
    assert len(files_of(tiny)) == sum(info.count for info in BagReader(tiny).topics.values())
    both = record(tmp_path / "d" / "bag", frames=4, split=BagSplit(0.1, 1000))
    assert len(files_of(both)) == 4


@pytest.mark.parametrize(
    ("scenario", "split"),
    [
        ("recording: {split_s: 60.0}", BagSplit(60.0, None)),
        ("recording: {compression: lz4, split_mb: 10}", BagSplit(None, 10)),
        ("recording: {}", BagSplit()),
        ("recording: {split_s: -1, split_mb: many}", BagSplit()),
        ("recording: 3", BagSplit()),
        ("[1, 2]", BagSplit()),
        ("{", BagSplit()),
        ("", BagSplit()),
    ],
)
def test_an_attack_splits_as_the_recorded_scenario_says(scenario: str, split: BagSplit) -> None:
    assert BagSplit.of(Provenance({"scenario": scenario})) == split


def test_finished_files_hold_no_memory(tmp_path: Path) -> None:
    """Of a megabyte each, compressed; a recording of hours has hundreds."""
    text = "x" * 1_100_000

    def most_bytes(files: int) -> int:
        tracemalloc.start()
        with BagWriter(tmp_path / f"{files}", provenance={}, split=BagSplit(after_s=1)) as writer:
            for second in range(files):
                writer.write(SCENARIO_INFO, string(text), second * 10**9)
        assert len(files_of(tmp_path / f"{files}")) == files
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    assert most_bytes(12) < most_bytes(3) + len(text)
