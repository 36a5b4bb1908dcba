"""The debug topic of touched points: what it shows, leaving it out, and that no input holds it."""

from __future__ import annotations

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import find_lidar_topic, read_frames
from advpipe.pipeline.bag.inspect import describe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.points import ADDED, MOVED, REMOVED, PointLabels
from advpipe.pipeline.messages.cloud import StampedCloud, cloud_from_cdr, xyz
from advpipe.pipeline.messages.debug import TOUCHED_POINT_DTYPE, is_debug
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.debug import touched_cloud
from advpipe.stages.attack.lidar.base import LidarResult
from advpipe.stages.attack.run import AttackRequest, attack

LIDAR, TOUCHED = "/ego/lidar/points", "/advpipe/debug/ego/lidar/points"
DETACH = AttackSpec(type="detach", parameters={"ratio": 0.1}, detector="linear_detector:Shipped")
REQUEST = AttackRequest((DETACH,), 3)
WITHOUT_DEBUG = AttackRequest((DETACH,), 3, debug=False)


@pytest.fixture
def adversarial(clean_bag, tmp_path):
    attack(clean_bag, tmp_path / "adv", REQUEST)
    return tmp_path / "adv"


def raw_by_topic(bag):
    found = {}
    for raw in BagReader(bag, debug=True).raw_messages():
        found.setdefault(raw.topic.name, []).append((raw.log_time_ns, raw.sequence, raw.cdr))
    return found


def points_of(message):
    return np.frombuffer(bytes(message.data), TOUCHED_POINT_DTYPE)


def test_independent_readers_find_the_removed_points_where_they_were(clean_bag, adversarial):
    labels = pq.read_table(adversarial / "labels.parquet").to_pydict()
    frames = list(read_frames(clean_bag))
    with (adversarial / "adv_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = [(log.log_time, message) for *_, log, message in reader.iter_decoded_messages([TOUCHED])]
    with AnyReader([adversarial]) as reader:
        connections = [each for each in reader.connections if each.topic == TOUCHED]
        same = [reader.deserialize(raw, connections[0].msgtype) for *_, raw in reader.messages(connections)]
    attacked = [frame for frame in frames if frame.index != 4]  # nothing is changed in frame 4
    assert len(found) == len(same) == len(attacked) == 5
    for frame, (log_time_ns, message), other in zip(attacked, found, same, strict=True):
        points = points_of(message)
        assert points.tobytes() == points_of(other).tobytes()
        assert log_time_ns == frame.stamp_ns
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == frame.stamp_ns
        assert [field.name for field in message.fields] == list(TOUCHED_POINT_DTYPE.names)
        removed = [p for p, f in zip(labels["point"], labels["frame"], strict=True) if f == frame.index]
        np.testing.assert_array_equal(xyz(points), xyz(frame.cloud[removed]))
        assert set(points["action"]) == {1}
        assert hex(points["rgb"].view(np.uint32)[0]) == "0xe33d3d"


def test_the_cloud_keeps_stamp_and_frame(adversarial):
    raw = raw_by_topic(adversarial)
    clouds = {time_ns: cloud_from_cdr(cdr) for time_ns, _, cdr in raw[LIDAR]}
    for time_ns, _, cdr in raw[TOUCHED]:
        touched = cloud_from_cdr(cdr)
        assert touched[:2] == clouds[time_ns][:2]


def test_moved_and_added_points_stand_at_their_new_positions(make_cloud):
    clean = make_cloud([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    new = make_cloud([[0, 0, 0], [2, 0.5, 0], [3, 0, 0], [9, 9, 9]])
    labels = PointLabels(
        np.array([1, 2, -1]), np.array([REMOVED, MOVED, ADDED]), np.array([np.nan, 0.5, 12.0])
    )
    topic, cdr = touched_cloud(LIDAR, StampedCloud(5, "roof", clean), LidarResult(new, labels))
    assert topic.name == TOUCHED
    touched = np.frombuffer(cdr[-1 - 3 * TOUCHED_POINT_DTYPE.itemsize : -1], TOUCHED_POINT_DTYPE)
    np.testing.assert_array_equal(xyz(touched), [[1, 0, 0], [2, 0.5, 0], [9, 9, 9]])
    assert touched["action"].tolist() == [1, 2, 3]
    np.testing.assert_array_equal(touched["displacement_m"], np.float32([np.nan, 0.5, 12.0]))


def test_without_debug_the_bag_is_the_same_but_for_the_topic(clean_bag, adversarial, tmp_path):
    attack(clean_bag, tmp_path / "plain", WITHOUT_DEBUG)
    plain, full = raw_by_topic(tmp_path / "plain"), raw_by_topic(adversarial)
    assert not any(map(is_debug, plain))
    assert full.keys() - plain.keys() == {TOUCHED}
    assert {name: full[name] for name in plain} == plain
    for table in ("labels.parquet", "frames.parquet"):
        assert (adversarial / table).read_bytes() == (tmp_path / "plain" / table).read_bytes()
    for bag, expected in ((adversarial, True), (tmp_path / "plain", False)):
        assert BagReader(bag).provenance.fields.debug is expected
        assert yaml.safe_load((bag / "attack.yaml").read_text())["debug"] is expected


def test_no_input_contains_the_debug_topic(adversarial):
    reader = BagReader(adversarial)
    assert not any(map(is_debug, reader.topics))
    assert not any(is_debug(raw.topic.name) for raw in reader.raw_messages())
    assert list(reader.raw_messages([TOUCHED])) == []
    for each in (reader, BagReader(adversarial, debug=True)):
        assert lidar_topics(each) == [LIDAR]
    with pytest.raises(UsageError, match="has no clouds on /advpipe/debug"):
        find_lidar_topic(reader, TOUCHED)
    described = describe(adversarial)
    assert described.clouds == 6
    assert TOUCHED in {topic.name for topic in described.topics}  # inspect shows that it is there


def test_the_debug_topic_of_another_tools_bag_is_no_lidar_either(clean_bag, tmp_path):
    with BagWriter(tmp_path / "theirs", provenance={}) as bag:
        for raw in BagReader(clean_bag).raw_messages():
            if raw.topic.name != "/scenario/info":
                bag.copy(raw)
    attack(tmp_path / "theirs", tmp_path / "adv", REQUEST)
    assert TOUCHED in BagReader(tmp_path / "adv", debug=True).topics
    assert lidar_topics(BagReader(tmp_path / "adv", debug=True)) == [LIDAR]
    assert len(list(read_frames(tmp_path / "adv"))) == 6


@pytest.mark.parametrize("request_", [REQUEST, WITHOUT_DEBUG], ids=["debug", "no debug"])
def test_a_second_attack_does_not_copy_what_the_first_one_did(adversarial, tmp_path, request_):
    attack(adversarial, tmp_path / "twice", request_)
    touched = raw_by_topic(tmp_path / "twice").get(TOUCHED, [])
    assert len(touched) == (5 if request_.debug else 0)
    first = {time_ns: cdr for time_ns, _, cdr in raw_by_topic(adversarial)[TOUCHED]}
    assert all(first[time_ns] != cdr for time_ns, _, cdr in touched)
