import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.types import schema_text, serialise, typestore

Record = Callable[..., Path]


def read_all(path: Path) -> int:
    """How many messages there are, after using all of the bag."""
    reader = BagReader(path)
    assert isinstance(reader.provenance, Provenance)
    for topic in reader.topics:
        reader.log_times_ns(topic)
    return sum(reader.decode(raw) is not None for raw in reader.raw_messages())


@pytest.mark.oracle
def test_messages_are_those_that_rosbags_reads(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag")
    with AnyReader([bag]) as reader:
        expected = sorted((stamp, c.topic, bytes(cdr)) for c, stamp, cdr in reader.messages())
    ours = [(raw.log_time_ns, raw.topic.name, raw.cdr) for raw in BagReader(bag).raw_messages()]
    assert sorted(ours) == expected
    assert [stamp for stamp, _, _ in ours] == [stamp for stamp, _, _ in expected]


@pytest.mark.oracle
@pytest.mark.parametrize("version", [8, 9])
def test_a_bag_of_rosbags_is_read_and_copied(tmp_path: Path, record_foreign: Record, version: int) -> None:
    bag = record_foreign(tmp_path / "foreign", version=version)
    reader = BagReader(bag)
    assert reader.provenance == {}
    assert {name: (info.type, info.count) for name, info in reader.topics.items()} == {
        "/carla/hero/lidar": ("sensor_msgs/msg/PointCloud2", 3),
        "/labels": ("vision_msgs/msg/Detection3DArray", 3),
        "/tf": ("tf2_msgs/msg/TFMessage", 3),
    }
    with BagWriter(tmp_path / "copy", provenance={}) as writer:
        for raw in reader.raw_messages():
            writer.copy(raw)
    with AnyReader([bag]) as theirs, AnyReader([tmp_path / "copy"]) as ours:
        expected = [(c.topic, stamp, bytes(cdr)) for c, stamp, cdr in theirs.messages()]
        assert [(c.topic, stamp, bytes(cdr)) for c, stamp, cdr in ours.messages()] == expected


def test_chosen_topics_and_times(tmp_path: Path, record: Record) -> None:
    reader = BagReader(record(tmp_path / "bag", frames=5))
    times_ns = reader.log_times_ns("/clock")
    assert np.diff(times_ns).tolist() == [100_000_000] * 4
    chosen = list(reader.raw_messages(["/clock", "/tf"], int(times_ns[1]), int(times_ns[2])))
    assert [raw.topic.name for raw in chosen] == ["/clock", "/tf"] * 2
    assert {raw.log_time_ns for raw in chosen} == set(times_ns[1:3].tolist())


def test_decoded_messages(tmp_path: Path, record: Record) -> None:
    reader = BagReader(record(tmp_path / "bag"))
    fixes = list(reader.messages("/ego/gnss/fix"))
    assert [build.stamp_ns(fix) for _, fix in fixes] == [stamp_ns for stamp_ns, _ in fixes]
    assert fixes[0][1].latitude == 50.1
    with pytest.raises(AdvpipeError, match=r"has no topic /nothing; it has: /clock, /ego"):
        next(reader.messages("/nothing"))


def test_several_files_are_one_stream(tmp_path: Path, record: Record) -> None:
    """A rosbag2 recording split in two, put together from two bags of ours."""
    whole, late = record(tmp_path / "bag", frames=2), record(tmp_path / "late", frames=4)
    shutil.copy(late / "late_0.mcap", whole / "bag_1.mcap")
    metadata = yaml.safe_load((whole / "metadata.yaml").read_text())
    metadata["rosbag2_bagfile_information"]["relative_file_paths"] = ["bag_0.mcap", "bag_1.mcap"]
    (whole / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    reader = BagReader(whole)
    assert reader.topics["/clock"].count == 6
    steps = [raw.log_time_ns for raw in reader.raw_messages(["/clock"])]
    assert steps == sorted(steps)
    assert steps == reader.log_times_ns("/clock").tolist()


@pytest.mark.parametrize("use_chunking", [False, True])
@pytest.mark.parametrize("in_order", [False, True])
def test_a_file_without_an_index(tmp_path: Path, use_chunking: bool, in_order: bool) -> None:
    path, options = tmp_path / "plain.mcap", {"use_statistics": False, "repeat_channels": False}
    with path.open("wb") as stream:
        writer = Writer(stream, use_chunking=use_chunking, **options)
        writer.start("ros2")
        name = "rosgraph_msgs/msg/Clock"
        schema = writer.register_schema(name, "ros2msg", schema_text(name).encode())
        channel = writer.register_channel("/clock", "cdr", schema)
        for stamp_ns in (1, 2, 3) if in_order else (1, 3, 2):
            writer.add_message(channel, stamp_ns, serialise(build.clock(stamp_ns), name), stamp_ns)
        writer.finish()
    if in_order:
        assert [stamp_ns for stamp_ns, _ in BagReader(path).messages("/clock")] == [1, 2, 3]
        assert BagReader(path).log_times_ns("/clock").tolist() == [1, 2, 3]
    else:
        with pytest.raises(AdvpipeError, match="must be in time order"):
            list(BagReader(path).raw_messages())


@pytest.mark.parametrize(
    ("name", "is_read"), [("old_msgs/msg/Guess", True), ("vision_msgs/msg/ObjectHypothesis", False)]
)
def test_types_are_read_as_the_bag_defines_them(tmp_path: Path, name: str, is_read: bool) -> None:
    """vision_msgs before 3.0 had other fields under the same name: it is refused, for readers need ours."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    old = get_typestore(Stores.ROS2_FOXY)
    old.register(get_types_from_msg("string id\nfloat64 score\n", name))
    with RosbagsWriter(tmp_path / "old", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/old", name, typestore=old)
        writer.write(connection, 5, old.serialize_cdr(old.types[name](id="car", score=0.5), name))
    messages = BagReader(tmp_path / "old").messages("/old")
    if is_read:
        ((stamp_ns, message),) = messages
        assert (stamp_ns, message.id, message.score) == (5, "car", 0.5)
    else:
        with pytest.raises(AdvpipeError, match=r"of another release, without the field .*class_id"):
            list(messages)


def refused(path: Path) -> str:
    """The one line that says why a path cannot be used; it names the path."""
    with pytest.raises(AdvpipeError) as caught:
        read_all(path)
    line = str(caught.value)
    assert "\n" not in line
    assert str(path) in line
    return line


def test_missing_and_empty(tmp_path: Path) -> None:
    assert "does not exist" in refused(tmp_path / "nothing")
    (tmp_path / "empty.mcap").touch()
    assert "is empty" in refused(tmp_path / "empty.mcap")
    (tmp_path / "folder").mkdir()
    assert "holds no metadata.yaml" in refused(tmp_path / "folder")


def test_no_metadata_yaml(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag")
    (bag / "metadata.yaml").unlink()
    assert "ros2 bag reindex" in refused(bag)
    assert read_all(bag / "bag_0.mcap") == 34


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "is missing"),
        ("[1, 2", "not valid YAML"),
        ("\0\1\2", "not valid YAML"),
        ("rosbag2_bagfile_information: 3", "is missing"),
        ("rosbag2_bagfile_information: {storage_identifier: sqlite3}", "rosbags-convert"),
        (
            "rosbag2_bagfile_information: {storage_identifier: mcap, compression_mode: FILE}",
            "rosbags-convert",
        ),
        ("rosbag2_bagfile_information: {storage_identifier: mcap}", "lists no files"),
        ("rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: [a]}", "is missing"),
    ],
)
def test_metadata_that_is_no_use(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "metadata.yaml").write_text(text)
    assert reason in refused(tmp_path)


def test_garbage(tmp_path: Path) -> None:
    path = tmp_path / "noise.mcap"
    path.write_bytes(np.random.default_rng(0).bytes(100_000))
    assert "is not an MCAP file" in refused(path)


def test_no_ros_bag(tmp_path: Path) -> None:
    path = tmp_path / "json.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("")
        schema = writer.register_schema("thing", "jsonschema", b"{}")
        channel = writer.register_channel("/thing", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    assert "/thing is encoded as 'json'" in refused(path)


def test_every_cut_is_found(tmp_path: Path, record: Record) -> None:
    whole = (record(tmp_path / "bag", frames=1) / "bag_0.mcap").read_bytes()
    path = tmp_path / "cut.mcap"
    for length in [*range(0, 40), *range(40, len(whole) - 40, 211), *range(len(whole) - 40, len(whole))]:
        path.write_bytes(whole[:length])
        refused(path)


@pytest.mark.parametrize("compression", ["zstd", "none"])
def test_a_flipped_bit_is_found_or_harmless(tmp_path: Path, record: Record, compression: str) -> None:
    """Reading gives what was written, or an error; never anything else."""
    bag = record(tmp_path / "bag", frames=1, compression=compression)
    original = BagReader(bag)
    expected = list(original.raw_messages())
    (original_stamp_ns,) = original.log_times_ns("/ego/lidar/points").tolist()
    whole = (bag / "bag_0.mcap").read_bytes()
    anywhere = np.random.default_rng(2).integers(0, 8 * len(whole), 100)
    record_start = whole.index(b"\7\0\0\0advpipe", 100) - 9  # opcode and length
    provenance = 8 * record_start + np.arange(0, 8 * 120, 11)
    places, found = [*anywhere.tolist(), *provenance.tolist()], 0
    for place in places:
        path = flipped(whole, place, tmp_path / "flipped.mcap")
        try:
            reader = BagReader(path)
            assert reader.provenance == original.provenance
            assert list(reader.raw_messages()) == expected
            assert [frame.stamp_ns for frame in read_frames(path)] == [original_stamp_ns]
        except AdvpipeError:
            found += 1
    assert found > len(places) / 2


def test_damage_without_checksums_is_read_or_refused(tmp_path: Path, record_foreign: Record) -> None:
    """rosbags writes no checksums: a flipped bit may pass unseen, but nothing may crash."""
    (path,) = record_foreign(tmp_path / "foreign").glob("*.mcap")
    whole = path.read_bytes()
    for place in np.random.default_rng(3).integers(0, 8 * len(whole), 150).tolist():
        try:
            read_all(flipped(whole, place, tmp_path / "flipped.mcap"))
        except AdvpipeError as error:
            said = str(error)
            assert "flipped.mcap" in said


def flipped(whole: bytes, place: int, path: Path) -> Path:
    """A file with one bit changed."""
    changed = bytearray(whole)
    changed[place // 8] ^= 1 << (place % 8)
    path.write_bytes(changed)
    return path


def test_a_message_of_another_type_is_one_line(tmp_path: Path) -> None:
    from advpipe.pipeline.messages import topics

    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write_cdr(topics.TF, b"\0\1\0\0\xff\xff\xff\xff", 7)
    assert "a message of /tf at 7 ns is not a valid tf2_msgs/msg/TFMessage" in refused(tmp_path / "bag")
    assert typestore() is not None
