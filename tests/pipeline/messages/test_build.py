import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.types import serialise, typestore

BOXES = Boxes(
    np.array([[1.0, 2, 3, 4, 5, 6, -0.7], [0, 0, 0, 1, 1, 2, 3.0]]),
    np.array([1, 3]),
    ("bus", "anna"),
    np.array([[7.0, 8, 9], [0, 0, 0]]),
)
EXAMPLES = {
    "nav_msgs/msg/Odometry": build.odometry(1, se3_from_yaw([1, 2, 3], 0.4, 0.1), [5, 0, 0], [0, 0, 0.2]),
    "sensor_msgs/msg/Imu": build.imu(
        1, [0.5, -1.0, 9.8], [0.1, 0.2, 0.3], force_stddev_mps2=0.02, rate_stddev_radps=0.003
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": build.initial_pose(
        1, [1, 2, 3], [0, 0, 0.6, 0.8], np.diag([1, 2, 3, 4, 5, 6])
    ),
    "sensor_msgs/msg/NavSatFix": build.nav_sat_fix(1, 50, 8, 100, std_m=(1, 2, 3)),
    "tf2_msgs/msg/TFMessage": build.transforms(1, [("map", "ego", se3_from_yaw([1, 2, 3], 4))]),
    "vision_msgs/msg/Detection3DArray": build.detections_message(1, "map", BOXES),
    "advpipe_msgs/msg/RoadUserArray": build.road_users(1, "map", BOXES, [10, 0], [0.25, 0]),
    "rosgraph_msgs/msg/Clock": build.clock(1),
    "std_msgs/msg/String": build.string("grüß"),
}


@pytest.mark.oracle
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_message_survives_serialisation(name: str) -> None:
    cdr = serialise(EXAMPLES[name], name)
    assert serialise(typestore().deserialize_cdr(cdr, name), name) == cdr


def test_stamps_at_the_end_of_a_second_are_exact() -> None:
    stamp = build.time(12_999_999_999)
    assert (stamp.sec, stamp.nanosec) == (12, 999_999_999)


def test_a_pose_round_trips() -> None:
    map_SE3_base = se3_from_yaw([1, 2, 3], 2.5, -0.3)
    np.testing.assert_allclose(build.se3_from_pose(build.pose(map_SE3_base)), map_SE3_base, atol=1e-15)
    (transform,) = build.transforms(0, [("a", "b", map_SE3_base)]).transforms
    np.testing.assert_allclose(build.se3_from_transform(transform.transform), map_SE3_base, atol=1e-15)
    assert (transform.header.frame_id, transform.child_frame_id) == ("a", "b")


def test_detections_have_the_boxes_fields() -> None:
    bus, anna = EXAMPLES["vision_msgs/msg/Detection3DArray"].detections
    assert (bus.id, bus.results[0].hypothesis.class_id) == ("bus", "truck")
    assert (anna.id, anna.results[0].hypothesis.class_id) == ("anna", "pedestrian")
    assert (bus.bbox.size.x, bus.bbox.size.y, bus.bbox.size.z) == (4, 5, 6)
    assert bus.bbox.center.orientation.z == pytest.approx(np.sin(-0.35))


def test_road_users_have_the_boxes_fields() -> None:
    bus, _ = EXAMPLES["advpipe_msgs/msg/RoadUserArray"].road_users
    assert (bus.id, bus.class_id, bus.lidar_points, bus.occlusion) == ("bus", "truck", 10, 0.25)
    assert (bus.velocity.x, bus.velocity.y, bus.velocity.z) == (7, 8, 9)


def test_a_fix_has_its_covariance() -> None:
    fix = EXAMPLES["sensor_msgs/msg/NavSatFix"]
    assert fix.position_covariance.tolist() == [1, 0, 0, 0, 4, 0, 0, 0, 9]
    assert fix.position_covariance_type == fix.COVARIANCE_TYPE_DIAGONAL_KNOWN


def test_imu_messages_have_their_fields() -> None:
    imu = EXAMPLES["sensor_msgs/msg/Imu"]
    force, rate = imu.linear_acceleration, imu.angular_velocity
    assert (force.x, force.y, force.z, rate.x, rate.y, rate.z) == (0.5, -1.0, 9.8, 0.1, 0.2, 0.3)
    assert imu.linear_acceleration_covariance == pytest.approx([4e-4, 0, 0, 0, 4e-4, 0, 0, 0, 4e-4])
    assert imu.angular_velocity_covariance[[0, 4, 8]] == pytest.approx([9e-6] * 3)
    assert imu.orientation_covariance[0] == -1  # sensor_msgs/Imu: no estimate of the orientation
    assert imu.header.frame_id == "ego/imu"


def test_odometry_has_its_covariances() -> None:
    """ROS writes them row by row: x, y, z, and rotations about x, y, z."""
    covariance = np.zeros((6, 6))
    covariance[1, 5] = covariance[5, 1] = 0.25
    pose_only = build.odometry(1, np.eye(4), [0] * 3, [0] * 3, pose_covariance=covariance)
    assert np.flatnonzero(pose_only.pose.covariance).tolist() == [11, 31]
    assert not pose_only.twist.covariance.any()
    twist_only = build.odometry(1, np.eye(4), [0] * 3, [0] * 3, twist_covariance=np.eye(6))
    assert twist_only.twist.covariance[[0, 7, 35]].tolist() == [1, 1, 1]
    assert not twist_only.pose.covariance.any()


def test_a_receiver_without_satellites_states_no_fix() -> None:
    """sensor_msgs/NavSatStatus: STATUS_NO_FIX is -1, STATUS_FIX 0."""
    assert build.nav_sat_fix(1, 50, 8, 100, is_fix=False).status.status == -1
    assert build.nav_sat_fix(1, 50, 8, 100).status.status == 0


def test_an_initial_pose_is_exact() -> None:
    pose = EXAMPLES["geometry_msgs/msg/PoseWithCovarianceStamped"].pose
    assert (pose.pose.orientation.z, pose.pose.orientation.w) == (0.6, 0.8)
    assert pose.covariance[[0, 7, 14, 21, 28, 35]].tolist() == [1, 2, 3, 4, 5, 6]
