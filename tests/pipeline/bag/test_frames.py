import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import FrameSlice, count_frames, has_ground_truth, read_frames
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr

Record = Callable[..., Path]
EGO = topics.VehicleTopics("ego")


def test_boxes_are_in_the_lidar_frame(tmp_path: Path, record: Record) -> None:
    """By hand: the car stands at (10, 5, 0.8) facing +x and drives to +y at 3 m/s.

    The ego stands at (k, 0, 0) facing +y; its LiDAR is 1 m ahead, at (k, 1, 2). So the car is 5 - 1 = 4 m
    ahead, 10 - k to the right, 1.2 m below, faces right, and drives ahead.
    """
    frames = list(read_frames(record(tmp_path / "bag", frames=3)))
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert np.diff([frame.stamp_ns for frame in frames]).tolist() == [100_000_000] * 2
    for k, frame in enumerate(frames):
        expected = [[4.0, -(10.0 - k), -1.2, 4.5, 1.8, 1.6, -np.pi / 2]]
        np.testing.assert_allclose(frame.boxes.geometry, expected, atol=1e-12)
        np.testing.assert_allclose(frame.boxes.velocity_mps, [[3.0, 0.0, 0.0]], atol=1e-12)
        assert frame.boxes.ids == ("veh7",)
        assert frame.boxes.labels.tolist() == [0]
        assert frame.cloud.dtype == POINT_DTYPE
        assert len(frame.cloud) == 200


def test_a_slice_counts_the_bags_clouds(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag", frames=7)
    everything = {frame.index: frame for frame in read_frames(bag)}
    for text, indices in {"1:6:2": [1, 3, 5], "5:": [5, 6], ":2": [0, 1], "4": [4], "::3": [0, 3, 6]}.items():
        frames = list(read_frames(bag, FrameSlice.parse(text)))
        assert [frame.index for frame in frames] == indices
        for frame in frames:
            assert frame.cloud.tobytes() == everything[frame.index].cloud.tobytes()
            assert (frame.boxes.geometry == everything[frame.index].boxes.geometry).all()
    assert count_frames(bag) == 7
    with pytest.raises(AdvpipeError, match="select none of the bag's 7 frames"):
        read_frames(bag, FrameSlice.parse("7:"))


def test_skipped_clouds_are_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cloud fills a chunk of its own; only chunks beside the chosen frame may be unpacked."""
    import mcap.reader

    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        for frame in range(20):
            cdr = cloud_to_cdr(np.zeros(60_000, POINT_DTYPE), frame * 10**8, "ego/lidar")
            bag.write_cdr(EGO.lidar_points, cdr, frame * 10**8)
    unpacked = []
    original = mcap.reader.breakup_chunk
    monkeypatch.setattr(
        mcap.reader, "breakup_chunk", lambda *args, **named: unpacked.append(1) or original(*args, **named)
    )
    (frame,) = read_frames(tmp_path / "bag", FrameSlice.parse("10"))
    assert frame.index == 10
    assert len(unpacked) <= 2


def test_another_tools_bag(tmp_path: Path, record_foreign: Record) -> None:
    """The LiDAR stands at (k, 0, 2) facing +x: the car at (10, 5, 0.8) is 10 - k ahead and 5 to the left."""
    bag = record_foreign(tmp_path / "foreign")
    assert has_ground_truth(bag)
    frames = list(read_frames(bag))
    assert len(frames) == 3
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame.boxes.geometry, [[10.0 - k, 5, -1.2, 4.5, 1.8, 1.6, 0]], atol=1e-12)
        assert np.isnan(frame.boxes.velocity_mps).all()
        assert frame.cloud["ring"].max() == 0
    (second,) = read_frames(bag, FrameSlice.parse("1"))
    assert second.boxes.geometry.tolist() == frames[1].boxes.geometry.tolist()


def write_frame(
    bag: BagWriter, stamp_ns: int = 0, *, boxes: Boxes | None = None, frame_id: str = "map", truth_ns: int = 0
) -> None:
    cdr = cloud_to_cdr(np.zeros(5, POINT_DTYPE), stamp_ns, EGO.lidar_frame)
    bag.write_cdr(EGO.lidar_points, cdr, stamp_ns)
    if boxes is not None:
        bag.write(EGO.objects, build.detections_message(truth_ns, frame_id, boxes), truth_ns)


ONE = Boxes(np.array([[1.0, 2, 3, 4, 2, 1.5, 0.5]]), np.array([3]), ("a",), np.zeros((1, 3)))


def test_boxes_in_the_clouds_own_frame_need_no_transform(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        write_frame(bag, boxes=ONE, frame_id=EGO.lidar_frame)
    (frame,) = read_frames(tmp_path / "bag")
    np.testing.assert_allclose(frame.boxes.geometry, ONE.geometry)
    assert frame.boxes.labels.tolist() == [3]


def test_a_bag_without_truth(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        write_frame(bag)
    (frame,) = read_frames(tmp_path / "bag")
    assert len(frame.boxes) == 0
    assert not has_ground_truth(tmp_path / "bag")


def test_a_frame_without_its_truth_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        write_frame(bag, 0, boxes=ONE, frame_id=EGO.lidar_frame)
        write_frame(bag, 100)
    frames = read_frames(tmp_path / "bag")
    next(frames)
    with pytest.raises(AdvpipeError, match="no message of /ego/ground_truth/objects has the stamp 100 ns"):
        next(frames)


def test_boxes_stamped_milliseconds_later_are_named(tmp_path: Path) -> None:
    """Another recorder's: logged some time after they were stamped."""
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        cdr = cloud_to_cdr(np.zeros(5, POINT_DTYPE), 10**9, EGO.lidar_frame)
        bag.write_cdr(EGO.lidar_points, cdr, 10**9 + 2_000_000)
        boxes = build.detections_message(10**9 + 4_000_000, EGO.lidar_frame, ONE)
        bag.write(EGO.objects, boxes, 10**9 + 9_000_000)
    line = (
        r"has the stamp 1000000000 ns of a cloud: the nearest is 4 ms later; give the boxes of each cloud "
        r"the cloud's header stamp, or choose frames where they have it \(frames='start:stop:step'\)"
    )
    with pytest.raises(AdvpipeError, match=line):
        list(read_frames(tmp_path / "bag"))


def test_boxes_that_begin_after_the_cloud(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        write_frame(bag, 0)
        write_frame(bag, 10**10, boxes=ONE, frame_id=EGO.lidar_frame, truth_ns=10**10)
    with pytest.raises(AdvpipeError, match="nor one near it; choose frames with ground truth"):
        list(read_frames(tmp_path / "bag"))


def test_the_transform_error_names_topics_that_can_be(tmp_path: Path) -> None:
    """Odometry is named by advpipe's own topics, which a bag of /velodyne_points has none of."""
    cloud = Topic("/velodyne_points", EGO.lidar_points.type)
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write_cdr(cloud, cloud_to_cdr(np.zeros(5, POINT_DTYPE), 0, "velodyne"), 0)
        bag.write(EGO.objects, build.detections_message(0, "map", ONE), 0)
    line = (
        "no transform connects the frame 'map' of /ego/ground_truth/objects to 'velodyne' at 0 ns; record "
        "/tf_static or /tf with one, stamped like each cloud, or give the boxes in the frame 'velodyne'$"
    )
    with pytest.raises(AdvpipeError, match=line):
        list(read_frames(tmp_path / "bag"))


def test_frames_that_nothing_ties(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        write_frame(bag, boxes=ONE)
    with pytest.raises(AdvpipeError, match=r"no transform connects the frame 'map' .* to 'ego/lidar'"):
        list(read_frames(tmp_path / "bag"))


def test_a_loop_of_transforms_ends(tmp_path: Path) -> None:
    loop = [("a", EGO.lidar_frame, np.eye(4)), (EGO.lidar_frame, "a", np.eye(4))]
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write(topics.TF_STATIC, build.transforms(0, loop), 0)
        write_frame(bag, boxes=ONE)
    with pytest.raises(AdvpipeError, match="no transform connects"):
        list(read_frames(tmp_path / "bag"))


def test_the_true_pose_wins_over_tf(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        true = build.odometry(0, np.eye(4), [0] * 3, [0] * 3, child_frame_id=EGO.lidar_frame)
        wrong = build.transforms(0, [("map", EGO.lidar_frame, se3_from_yaw([9, 9, 9], 1))])
        bag.write(EGO.true_odometry, true, 0)
        bag.write(topics.TF, wrong, 0)
        write_frame(bag, boxes=ONE)
    (frame,) = read_frames(tmp_path / "bag")
    np.testing.assert_allclose(frame.boxes.geometry, ONE.geometry)


@pytest.mark.parametrize(("name", "label"), [("Bus", 1), ("PEDESTRIAN", 3), ("bicycle", 2)])
def test_other_names_of_classes(tmp_path: Path, name: str, label: int) -> None:
    record_class(tmp_path / "bag", name)
    (frame,) = read_frames(tmp_path / "bag")
    assert frame.boxes.labels.tolist() == [label]


def test_an_unknown_class_is_refused(tmp_path: Path) -> None:
    record_class(tmp_path / "bag", "dragon")
    with pytest.raises(AdvpipeError, match="has the class 'dragon'; known are car, truck"):
        list(read_frames(tmp_path / "bag"))


def record_class(path: Path, name: str) -> None:
    with BagWriter(path, provenance={}) as bag:
        write_frame(bag)
        message = build.detections_message(0, EGO.lidar_frame, ONE)
        message.detections[0].results[0].hypothesis.class_id = name
        bag.write(EGO.objects, message, 0)


def test_which_lidar(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "none", provenance={}) as bag:
        bag.write(topics.CLOCK, build.clock(0), 0)
    with pytest.raises(AdvpipeError, match="holds no LiDAR clouds"):
        read_frames(tmp_path / "none")
    with BagWriter(tmp_path / "two", provenance={}) as bag:
        for name, points in (("a", 1), ("b", 2)):
            topic = topics.VehicleTopics(name).lidar_points
            bag.write_cdr(topic, cloud_to_cdr(np.zeros(points, POINT_DTYPE), 0, name), 0)
    with pytest.raises(
        AdvpipeError,
        match="several LiDAR topics and none is /ego/lidar/points; name one by lidar: /a/lidar/points, /b",
    ):
        read_frames(tmp_path / "two")
    with pytest.raises(AdvpipeError, match="no clouds on /c"):
        read_frames(tmp_path / "two", lidar_topic="/c")
    (frame,) = read_frames(tmp_path / "two", lidar_topic="/b/lidar/points")
    assert len(frame.cloud) == 2


def test_a_malformed_cloud_is_reported_with_its_place(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write_cdr(EGO.lidar_points, b"\0\1\0\0", 7)
    with pytest.raises(AdvpipeError, match="bag: /ego/lidar/points at 7 ns: malformed PointCloud2"):
        list(read_frames(tmp_path / "bag"))


def test_memory_stays_flat(tmp_path: Path) -> None:
    """40 clouds of 2.2 MB: never more than a few of them are held."""
    points = np.zeros(100_000, POINT_DTYPE)
    with BagWriter(tmp_path / "bag", provenance={}, compression="none") as bag:
        for frame in range(40):
            stamp_ns = frame * 10**8
            bag.write_cdr(EGO.lidar_points, cloud_to_cdr(points, stamp_ns, EGO.lidar_frame), stamp_ns)
            bag.write(EGO.objects, build.detections_message(stamp_ns, EGO.lidar_frame, ONE), stamp_ns)
    tracemalloc.start()
    assert sum(len(frame.boxes) for frame in read_frames(tmp_path / "bag")) == 40
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_bytes < 10 * points.nbytes


@pytest.mark.parametrize(
    ("name", "points", "identity", "centre_m"),
    [
        (None, 1, "car1", [20, 0, -1]),
        ("/ego/lidar/points", 1, "car1", [20, 0, -1]),
        ("/ego/roof/points", 2, "car1", [20, 0, -3]),
        ("/bus_3/front/points", 3, "truck1", [-5, 0, 0]),
    ],
)
def test_each_lidar_has_its_vehicles_truth(
    tmp_path: Path,
    record_fleet: Record,
    name: str | None,
    points: int,
    identity: str,
    centre_m: list[float],
) -> None:
    record_fleet(tmp_path / "bag")
    assert count_frames(tmp_path / "bag", name) == 2
    assert has_ground_truth(tmp_path / "bag", name)
    for frame in read_frames(tmp_path / "bag", lidar_topic=name):
        assert len(frame.cloud) == points
        assert frame.boxes.ids == (identity,)
        np.testing.assert_allclose(frame.boxes.geometry[0, :3], centre_m, atol=1e-12)


def test_clouds_are_unpacked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Truth and clouds come from one pass; one chunk more tells when the truth was logged."""
    import mcap.reader

    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        for stamp_ns in range(10):
            cdr = cloud_to_cdr(np.zeros(60_000, POINT_DTYPE), stamp_ns, "ego/lidar")
            bag.write_cdr(EGO.lidar_points, cdr, stamp_ns)
            bag.write(EGO.objects, build.detections_message(stamp_ns, EGO.lidar_frame, ONE), stamp_ns)
    unpacked = []
    original = mcap.reader.breakup_chunk
    monkeypatch.setattr(
        mcap.reader, "breakup_chunk", lambda *args, **named: unpacked.append(1) or original(*args, **named)
    )
    assert len(list(read_frames(tmp_path / "bag"))) == 10
    assert len(unpacked) <= 11 + 1  # the last truth lies in a chunk of its own
