"""Recordings of ROS: clouds, boxes and poses as the messages say, in each format; and damaged ones."""

from __future__ import annotations

import sys
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer

import advpipe.sample
from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import invert, se3, se3_from_yaw, yaw_of
from advpipe.pipeline.messages.build import se3_from_transform
from advpipe.stages.import_.options import ImportOptions
from advpipe.stages.import_.rosbag import recording
from advpipe.stages.import_.rosbag.form import RosbagForm
from advpipe.stages.verify.run import verify

sys.path.insert(0, str(Path(__file__).parent))

import ros_drives
from importing import import_form
from point_bytes import some_points
from ros_drives import FORMATS, START_NS, STEP_NS, Made, Messages, record

CLOUD = "sensor_msgs/msg/PointCloud2"


imported = partial(import_form, "rosbag")


def opened(source: Path, **options: object):
    return RosbagForm().open(source, ImportOptions(**options))


def centre(pose: np.ndarray, height_m: float) -> np.ndarray:
    return pose @ se3(np.eye(3), (0, 0, height_m / 2))


@pytest.mark.parametrize("is_asynchronous", [False, True])
@pytest.mark.parametrize("form", FORMATS)
def test_a_drive_of_carlas_bridge(form: str, is_asynchronous: bool, tmp_path: Path) -> None:
    """The own vehicle is no object; vehicles' boxes stand on the ground; other vehicles do not count."""
    bag = record(
        tmp_path / "town", form, lambda made: ros_drives.carla(made, is_asynchronous=is_asynchronous)
    )
    summary = imported(bag, tmp_path / "d")
    frames = list(read_frames(summary.bag))
    assert [frame.stamp_ns for frame in frames] == [START_NS + k * STEP_NS for k in range(4)]
    for k, frame in enumerate(frames):
        points = ros_drives.carla_points(k)
        for name in points.dtype.names:
            assert np.array_equal(frame.cloud[name], points[name])
        assert frame.boxes.ids == ("31", "40")
        lidar_SE3_map = invert(ros_drives.ego_pose(frame.stamp_ns) @ ros_drives.EGO_SE3_LIDAR)
        expected = [
            (lidar_SE3_map @ centre(ros_drives.car_pose(frame.stamp_ns), 1.5), ros_drives.CAR_SIZE),
            (lidar_SE3_map @ ros_drives.WALKER_POSE, ros_drives.WALKER_SIZE),
        ]
        for box, (pose, size) in zip(frame.boxes.geometry, expected, strict=True):
            assert np.allclose(box, [*pose[:3, 3], *size, yaw_of(pose)], rtol=0, atol=1e-9)
        assert np.allclose(frame.boxes.velocity_mps[0], lidar_SE3_map[:3, :3] @ [5, 0, 0], atol=1e-9)
        assert frame.uncounted.boxes.class_names == ("other_vehicle",)
    (transform,) = next(BagReader(summary.bag).messages("/tf_static"))[1].transforms
    assert np.allclose(se3_from_transform(transform.transform), ros_drives.EGO_SE3_LIDAR, atol=1e-9)
    moving = [message.transforms[0] for _, message in BagReader(summary.bag).messages("/tf")]
    for k, transform in enumerate(moving):
        expected_pose = ros_drives.ego_pose(START_NS + k * STEP_NS)
        assert np.allclose(se3_from_transform(transform.transform), expected_pose, atol=1e-9)
    assert not verify(tmp_path / "d").findings


def test_objects_around_the_own_vehicle_are_preferred(tmp_path: Path) -> None:
    own = f"/carla/{ros_drives.EGO}/objects"
    bag = record(tmp_path / "town", "mcap", lambda made: ros_drives.carla(made, objects=own))
    assert f"Boxes: {own}." in opened(bag).notes[0]
    assert "Boxes: /carla/objects." in opened(bag, objects="/carla/objects").notes[0]


@pytest.mark.oracle
def test_advpipes_own_bag_comes_back(tmp_path: Path) -> None:
    """What `read_frames` says of the sample, it says of the sample imported as another tool's recording."""
    sample = Path(advpipe.sample.__file__ or "").parent / "clean" if advpipe.sample.__file__ else None
    sample = sample or Path(next(iter(advpipe.sample.__path__))) / "clean"
    summary = imported(sample, tmp_path / "d", frames="0:3")
    for ours, theirs in zip(read_frames(summary.bag), read_frames(sample), strict=False):
        assert ours.stamp_ns == theirs.stamp_ns
        assert ours.cloud.tobytes() == theirs.cloud.tobytes()
        around = np.hypot(*theirs.boxes.geometry[:, :2].T) > 3
        assert ours.boxes.ids == theirs.boxes[around].ids
        assert np.allclose(ours.boxes.geometry, theirs.boxes[around].geometry, rtol=0, atol=1e-9)


def lidar_with_odometry(made: Made) -> Messages:
    """A robot: mount on /tf_static, poses of odometry at 20 Hz between the clouds, channels and times."""
    mount = se3_from_yaw((0.3, 0.0, 0.9), 0.2)
    yield (
        "/tf_static",
        "tf2_msgs/msg/TFMessage",
        START_NS,
        made.tf(START_NS, ("base_link", "velodyne", mount)),
    )
    for k in range(8):
        stamp_ns = START_NS + k * STEP_NS // 2
        pose = se3_from_yaw((0.1 * k, 0.0, 0.0), 0.0)
        yield "/odom", "nav_msgs/msg/Odometry", stamp_ns, made.odometry(stamp_ns, "odom", "base_link", pose)
        if k % 2:
            later_ns = stamp_ns + STEP_NS // 4  # half way between two poses
            cloud = made.cloud(later_ns, "velodyne", some_points(k))
            yield "/points", "sensor_msgs/msg/PointCloud2", later_ns, cloud


@pytest.mark.parametrize("form", FORMATS)
def test_poses_between_those_of_odometry(form: str, tmp_path: Path) -> None:
    frames = list(opened(record(tmp_path / "r", form, lidar_with_odometry)).frames())
    assert len(frames) == 4
    for k, frame in enumerate(frames):
        vehicle = frame.vehicles["ego"]
        x_m = 0.1 * min(2 * k + 1.5, 7)
        assert np.allclose(vehicle.map_SE3_base, se3_from_yaw((x_m, 0, 0), 0), atol=1e-9)
        assert np.array_equal(vehicle.clouds["lidar"]["ring"], some_points(2 * k + 1)["ring"])
        assert np.allclose(vehicle.clouds["lidar"]["time"], some_points(2 * k + 1)["t"] * 1e-9, atol=1e-8)
        assert vehicle.boxes is None


def livox(made: Made) -> Messages:
    points = some_points(3, 50)
    item = made.store.types["livox_ros_driver2/msg/CustomPoint"]
    message = made(
        "livox_ros_driver2/msg/CustomMsg",
        header=made.header(START_NS, "livox_frame"),
        timebase=START_NS,
        point_num=50,
        lidar_id=0,
        rsvd=np.zeros(3, np.uint8),
        points=[
            item(int(p["t"]), float(p["x"]), float(p["y"]), float(p["z"]), 51, 0, int(p["ring"]))
            for p in points
        ],
    )
    yield "/livox/lidar", "livox_ros_driver2/msg/CustomMsg", START_NS, message


@pytest.mark.parametrize("form", ["ros1", "mcap"])
def test_clouds_of_livox(form: str, tmp_path: Path) -> None:
    (frame,) = opened(record(tmp_path / "r", form, livox), scale_intensity=1 / 255).frames()
    cloud = frame.vehicles["ego"].clouds["lidar"]
    assert np.array_equal(cloud["x"], some_points(3, 50)["x"])
    assert np.allclose(cloud["intensity"], 0.2)
    assert np.allclose(cloud["time"], some_points(3, 50)["t"] * 1e-9, atol=1e-8)


def two_lidars(made: Made) -> Messages:
    for name in ("/front/points", "/rear/points"):
        yield name, "sensor_msgs/msg/PointCloud2", START_NS, made.cloud(START_NS, "a", some_points())


def test_one_of_several_topics_has_to_be_named(tmp_path: Path) -> None:
    bag = record(tmp_path / "r", "mcap", two_lidars)
    with pytest.raises(UsageError, match=r"name one by --points: /front/points, /rear/points"):
        opened(bag)
    with pytest.raises(UsageError, match=r"no clouds on /rear/point; .* did you mean '/rear/points'"):
        opened(bag, points="/rear/point")
    assert opened(bag, points="/rear/points").frame_count == 1
    with pytest.raises(UsageError, match=r"no boxes on /rear/points; it has none"):
        opened(bag, points="/rear/points", objects="/rear/points")


def without_transform(made: Made) -> Messages:
    for topic, type_name, log_ns, message in ros_drives.carla(made):
        if topic != "/tf" and "odometry" not in topic:
            yield topic, type_name, log_ns, message


def wrong_layout(made: Made) -> Messages:
    cloud = made.cloud(START_NS, "a", some_points(), width=10**6, row_step=10**6 * 24)
    yield "/points", "sensor_msgs/msg/PointCloud2", START_NS, cloud


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    ("messages", "complaint"),
    [
        (without_transform, "no transform connects the frame 'map' of /carla/objects to 'ego_vehicle/lidar'"),
        (wrong_layout, "its fields do not fit its data"),
    ],
)
def test_messages_that_cannot_be_used(form: str, messages, complaint: str, tmp_path: Path) -> None:
    bag = record(tmp_path / "r", form, messages)
    with pytest.raises(AdvpipeError) as caught:
        imported(bag, tmp_path / "d")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "d").exists()


@pytest.mark.parametrize(
    ("form", "share"), [*product(FORMATS, (0.0, 0.1, 0.5)), ("ros1", 0.98), ("mcap", 0.98)]
)  # SQLite's last page may hold nothing that is read
def test_truncated_recordings(form: str, share: float, tmp_path: Path) -> None:
    bag = record(tmp_path / "r", form, ros_drives.carla)
    file = bag if bag.is_file() else next(file for file in bag.iterdir() if file.suffix != ".yaml")
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    with pytest.raises(AdvpipeError) as caught:
        imported(bag, tmp_path / "d")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "d").exists()


@pytest.mark.parametrize("compression", list(Ros1Writer.CompressionFormat))
def test_chunks_of_ros1_unpack_within_a_bound(
    compression: Ros1Writer.CompressionFormat, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Made("ros1")
    writer = Ros1Writer(tmp_path / "r.bag")
    writer.set_compression(compression)
    with writer as bag:
        connection = bag.add_connection("/points", CLOUD, typestore=made.store)
        cloud = made.cloud(START_NS, "a", some_points())
        bag.write(connection, START_NS, made.store.serialize_ros1(cloud, CLOUD))
    (frame,) = opened(tmp_path / "r.bag").frames()
    assert np.array_equal(frame.vehicles["ego"].clouds["lidar"]["x"], some_points()["x"])
    monkeypatch.setattr(recording, "_MOST_CHUNK_BYTES", 1000)
    with pytest.raises(AdvpipeError, match="a chunk unpacks to more than"):
        list(opened(tmp_path / "r.bag").frames())


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_recordings_compressed_per_file_or_message(
    plugin: StoragePlugin, mode: CompressionMode, tmp_path: Path
) -> None:
    """What `BagReader` does not read, and rosbags does."""
    made, connections = Made("mcap"), {}
    writer = Ros2Writer(tmp_path / "r", version=8, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer as bag:
        for topic, type_name, log_ns, message in ros_drives.carla(made):
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, type_name, typestore=made.store)
            bag.write(connections[topic], log_ns, made.store.serialize_cdr(message, type_name))
    frames = list(opened(tmp_path / "r").frames())
    assert [frame.stamp_ns for frame in frames] == [START_NS + k * STEP_NS for k in range(4)]
    assert all(len(frame.vehicles["ego"].boxes) == 2 for frame in frames)


def test_what_is_no_recording(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "two").mkdir()
    for name in ("two/a.bag", "two/b.mcap", "text.bag"):
        (tmp_path / name).write_bytes(b"no bag")
    for name, complaint in {
        "missing": "does not exist",
        "empty": "it holds no .bag, .mcap or .db3",
        "two": "it holds a.bag, b.mcap",
        "text.bag": "is not an MCAP file",
    }.items():
        with pytest.raises(UsageError, match=complaint):
            opened(tmp_path / name)
