import hashlib
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build, topics

Record = Callable[..., Path]


def only_mcap(bag: Path) -> Path:
    (path,) = bag.glob("*.mcap")
    return path


def hashes(bag: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(bag.iterdir())}


@pytest.mark.oracle
@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_rosbags_reads_every_message(tmp_path: Path, record: Record, compression: str) -> None:
    bag = record(tmp_path / "bag", frames=3, compression=compression)
    counts: dict[str, int] = {}
    with AnyReader([bag]) as reader:  # with the types that the bag itself defines
        assert reader.message_count == 26
        for connection, _, cdr in reader.messages():
            message = reader.deserialize(cdr, connection.msgtype)
            assert bytes(reader.typestore.serialize_cdr(message, connection.msgtype)) == bytes(cdr)
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
    assert counts == {name: 1 if name in ("/tf_static", "/scenario/info") else 3 for name in counts}
    assert len(counts) == 10


@pytest.mark.oracle
def test_mcap_library_accepts_it_whole(tmp_path: Path, record: Record) -> None:
    with only_mcap(record(tmp_path / "bag")).open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
        assert all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
        sequences: dict[str, list[int]] = {}
        for _, channel, message in reader.iter_messages():
            assert message.publish_time == message.log_time
            sequences.setdefault(channel.topic, []).append(message.sequence)
        assert sequences["/ego/lidar/points"] == [0, 1, 2, 3]
        stream.seek(0)
        assert len(list(StreamReader(stream, validate_crcs=True).records)) > 34  # all checksums


@pytest.mark.oracle
def test_metadata_yaml_is_version_8_on_single_lines(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag")
    text = (bag / "metadata.yaml").read_text()
    assert "&" not in text  # no YAML aliases
    assert all(":" in line or line.lstrip().startswith("- ") for line in text.splitlines())
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert information["version"] == 8
    assert information["relative_file_paths"] == ["bag_0.mcap"]
    assert information["duration"] == {"nanoseconds": 300_000_000}
    with AnyReader([bag]) as reader:
        qos = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
        digests = {c.topic: c.digest for c in reader.connections}
    assert qos["/tf_static"].durability is QosDurability.TRANSIENT_LOCAL
    assert qos["/tf_static"].depth == 1
    assert qos["/clock"].reliability is QosReliability.BEST_EFFORT
    assert qos["/ego/lidar/points"].depth == 5
    assert qos["/ego/lidar/points"].reliability is QosReliability.RELIABLE
    assert digests["/ego/ground_truth/objects"].startswith("RIHS01_793f5eab")


def test_mcap_alone_states_qos_and_type_hash(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag")
    assert BagReader(only_mcap(bag)).topics == BagReader(bag).topics
    with only_mcap(bag).open("rb") as stream:
        reader = make_reader(stream)
        channels = {channel.topic: channel.metadata for channel in reader.get_summary().channels.values()}
        records = {record.name: record.metadata for record in reader.iter_metadata()}
    assert channels["/tf"]["topic_type_hash"].startswith("RIHS01_")
    assert "\n" not in channels["/tf"]["offered_qos_profiles"]
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert yaml.safe_load(records["rosbag2"]["serialized_metadata"]) == metadata


def test_same_content_same_bytes(tmp_path: Path, record: Record) -> None:
    assert hashes(record(tmp_path / "a" / "bag")) == hashes(record(tmp_path / "b" / "bag"))


def fail_after_a_message(path: Path, overwrite: bool = False) -> None:
    with BagWriter(path, provenance={}, overwrite=overwrite) as bag:
        bag.write(topics.CLOCK, build.clock(0), 0)
        raise ZeroDivisionError


def write_text(path: Path, kilobytes: int) -> None:
    with BagWriter(path, provenance={"scenario": "x" * 5000}, compression="none") as bag:
        for stamp_ns in range(kilobytes):
            bag.write(topics.SCENARIO_INFO, build.string("x" * 1000), stamp_ns)


def test_an_error_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        fail_after_a_message(tmp_path / "bag")
    assert list(tmp_path.iterdir()) == []


def test_an_existing_bag_stays_unless_overwrite(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag", frames=1)
    before = hashes(bag)
    with pytest.raises(OutputExistsError, match="overwrite=True"):
        record(bag)
    with pytest.raises(ZeroDivisionError):
        fail_after_a_message(bag, overwrite=True)
    assert hashes(bag) == before
    record(bag, frames=2, overwrite=True)
    assert BagReader(bag).topics["/clock"].count == 2
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_only_a_bag_is_ever_replaced(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (home / "letter.txt").write_text("dear")
    file = tmp_path / "file"
    file.write_text("x")
    for path in (home, file):
        with pytest.raises(AdvpipeError, match="not replaced"):
            BagWriter(path, provenance={}, overwrite=True)
    assert (home / "letter.txt").read_text() == "dear"


KILLED = """
import os, signal, sys
from pathlib import Path
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.bag.writer import BagWriter
with BagWriter(Path(sys.argv[1]), provenance={}) as bag:
    for stamp_ns in range(10_000):
        bag.write(topics.SCENARIO_INFO, build.string("x" * 1000), stamp_ns)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_run_leaves_nothing_under_the_final_name(tmp_path: Path, record: Record) -> None:
    path = tmp_path / "bag"
    process = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert process.returncode == -signal.SIGKILL
    assert not path.exists()
    (leftover,) = tmp_path.iterdir()
    assert leftover.name.startswith(".bag.partial-")
    record(path)  # the next run cleans up
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]


def test_two_living_runs_do_not_disturb_each_other(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as first:
        first.write(topics.CLOCK, build.clock(0), 0)
        with pytest.raises(ZeroDivisionError):
            fail_after_a_message(tmp_path / "bag")
    assert BagReader(tmp_path / "bag").topics["/clock"].count == 1


def test_a_bag_that_appears_meanwhile_stays(tmp_path: Path, record: Record) -> None:
    with (
        pytest.raises(AdvpipeError, match="was created in the meantime"),
        BagWriter(tmp_path / "bag", provenance={}),
    ):
        record(tmp_path / "bag", frames=3)
    assert BagReader(tmp_path / "bag").topics["/clock"].count == 3
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize("limit_bytes", [2_000, 50_000, 3_000_000])
def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path, limit_bytes: int) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, before[1]))  # the kernel refuses to write more
    try:
        with pytest.raises(AdvpipeError, match="bag: cannot be written: File too large"):
            write_text(tmp_path / "bag", 4000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_paths_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with (
        pytest.raises(AdvpipeError, match="cannot be written: "),
        BagWriter(tmp_path / "file" / "bag", provenance={}),
    ):
        pass
    with pytest.raises(AdvpipeError, match="use one of zstd, lz4, none"):
        BagWriter(tmp_path / "bag", provenance={}, compression="gzip")


def test_wrong_input_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write(topics.CLOCK, build.clock(0), 0)
        with pytest.raises(AdvpipeError, match="outside the range that a bag can hold"):
            bag.write(topics.CLOCK, build.clock(0), -1)
        with pytest.raises(AdvpipeError, match="already holds rosgraph_msgs/msg/Clock"):
            bag.write(Topic("/clock", "std_msgs/msg/String"), build.string(""), 0)


@pytest.mark.oracle
def test_an_empty_bag_is_a_bag(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={"kind": "clean"}):
        pass
    with AnyReader([tmp_path / "bag"]) as reader:
        assert list(reader.messages()) == []
    assert BagReader(tmp_path / "bag").provenance == {"kind": "clean"}
    assert list(BagReader(tmp_path / "bag").raw_messages()) == []


def test_a_copy_is_equal_in_all_but_provenance(tmp_path: Path, record: Record) -> None:
    original = BagReader(record(tmp_path / "original"))
    with BagWriter(tmp_path / "copy", provenance={"kind": "attack"}) as writer:
        for raw in original.raw_messages():
            writer.copy(raw)
    copy = BagReader(tmp_path / "copy")
    assert list(copy.raw_messages()) == list(original.raw_messages())
    assert copy.topics == original.topics
