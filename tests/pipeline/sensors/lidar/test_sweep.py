"""Where rays leave from: mounting, and a vehicle that moves during the turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from advpipe.pipeline.geometry.transforms import se3_from_yaw, transform_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.sweep import mounting, poses_at
from advpipe.pipeline.sensors.world import Hits
from advpipe.stages.simulate.world.raycast.mesh import box_mesh, surface
from advpipe.stages.simulate.world.raycast.scene import Scene

QUIET = {
    "noise_stddev": 0.0,
    "dropoff_general_rate": 0.0,
    "dropoff_intensity_limit": 0.0,
    "imperfections": IDEAL,
}
TWIST = np.array([15.0, -0.5, 0.2, 0.02, -0.03, 0.4])


def generator(twist: np.ndarray) -> np.ndarray:
    """The twist as a (4, 4) matrix, whose matrix exponential scipy knows."""
    vx, vy, vz, x, y, z = twist
    return np.array([[0, -z, y, vx], [z, 0, -x, vy], [-y, x, 0, vz], [0, 0, 0, 0]])


@pytest.mark.parametrize("twist", [TWIST, np.array([3.0, 0, 1, 0, 0, 0]), np.array([0, 0, 0, 0, 0, -2.0])])
def test_a_constant_twist_moves_as_the_matrix_exponential(twist: np.ndarray) -> None:
    times_s = np.array([-0.1, -0.05, 0.0, 0.7])
    expected = [expm(generator(twist) * t) for t in times_s]
    assert np.allclose(poses_at(twist, times_s), expected, atol=1e-12)


def test_mounting_angles_have_the_documented_signs_and_order() -> None:
    # Pitch 30 looks down; yaw 90 looks to the left; roll 90 turns the left side up (REP-103).
    assert np.allclose(mounting(LidarSensor(pitch_deg=30))[:3, 0], [np.sqrt(0.75), 0, -0.5])
    assert np.allclose(mounting(LidarSensor(yaw_deg=90))[:3, 0], [0, 1, 0])
    assert np.allclose(mounting(LidarSensor(roll_deg=90))[:3, 1], [0, 0, 1])
    tilted = LidarSensor(x_m=1, y_m=-0.5, z_m=2, roll_deg=10, pitch_deg=20, yaw_deg=-70)
    expected = Rotation.from_euler("xyz", [10, 20, -70], degrees=True).as_matrix()
    assert np.allclose(mounting(tilted)[:3, :3], expected)
    assert np.allclose(mounting(tilted)[:3, 3], [1, -0.5, 2])


def test_a_tilted_sensor_measures_the_ground_correctly() -> None:
    sensor = LidarSensor(
        x_m=0.4, y_m=-0.3, z_m=1.7, roll_deg=4, pitch_deg=8, yaw_deg=25, channels=8, points_per_second=7200,
        upper_fov=-5, lower_fov=-20, **QUIET,
    )  # fmt: skip
    lidar, map_SE3_base = Lidar(sensor), se3_from_yaw((3.0, 4.0, 0.0), 1.0)
    ground = surface([[-200, -200, 0], [200, -200, 0], [0, 300, 0]], [[0, 1, 2]], "asphalt")
    cloud = lidar.measure(Scene(ground).cast(lidar.rays(map_SE3_base)), np.random.default_rng(0))
    assert len(cloud) > 600
    assert np.allclose(transform_points(map_SE3_base @ lidar.base_SE3_lidar, xyz(cloud))[:, 2], 0, atol=1e-4)


def moving(**keys: object) -> Lidar:
    return Lidar(
        LidarSensor(
            x_m=0.5, y_m=0.2, pitch_deg=2, yaw_deg=10, motion_distortion=True, points_per_second=64 * 9000,
            **QUIET, **keys,
        )
    )  # fmt: skip


def test_columns_leave_from_the_vehicles_current_pose() -> None:
    lidar, map_SE3_base = moving(), se3_from_yaw((10, 20, 0), 0.3)
    rays = lidar.rays(map_SE3_base, TWIST).reshape(-1, 64, 6)
    now = map_SE3_base @ lidar.base_SE3_lidar
    assert len(rays) == 900
    assert np.allclose(rays[-1, :, :3], now[:3, 3], atol=1e-5)
    # The first column leaves 899/900 of a turn, 0.0998889 s, before the last.
    before = map_SE3_base @ expm(-0.1 * 899 / 900 * generator(TWIST)) @ lidar.base_SE3_lidar
    assert np.allclose(rays[0, :, :3], before[:3, 3], atol=1e-5)
    assert np.linalg.norm(rays[0, 0, :3] - rays[-1, 0, :3]) == pytest.approx(1.5, abs=0.03)
    # It looks to the rear: the seam is there.
    assert np.allclose(rays[0, 0, 3:5] / np.linalg.norm(rays[0, 0, 3:5]), -before[:2, 0], atol=0.02)
    assert np.allclose(np.linalg.norm(rays[..., 3:], axis=-1), 1, atol=1e-6)


def undone(cloud: Cloud, lidar: Lidar) -> np.ndarray:
    """Points in base_link at the stamp, each brought there from its own instant with the known twist."""
    points = []
    for point in cloud:
        base_SE3_then = expm(generator(TWIST) * float(point["time"]))
        points.append(
            transform_points(base_SE3_then @ lidar.base_SE3_lidar, [point["x"], point["y"], point["z"]])
        )
    return np.array(points)


def test_motion_compensation_restores_the_world() -> None:
    lidar, map_SE3_base = moving(), se3_from_yaw((5.0, -2.0, 0.0), 0.2)
    crate = box_mesh((2.0, 3.0, 4.0), "steel").moved(11.0, 6.0, 0.0).transformed(map_SE3_base)
    cloud = lidar.measure(Scene(crate).cast(lidar.rays(map_SE3_base, TWIST)), np.random.default_rng(0))
    assert len(cloud) > 100
    assert cloud["time"].max() < 0
    assert cloud["time"].min() > -0.1
    # In base_link the crate's near face is x = 10, its right one y = 4.5; each point is on one of them.
    points = undone(cloud, lidar)
    off_m = np.minimum(np.abs(points[:, 0] - 10), np.abs(points[:, 1] - 4.5))
    assert off_m.max() < 1e-3
    assert np.allclose(
        transform_points(lidar.base_SE3_lidar, lidar.undistorted(cloud, TWIST)), points, atol=1e-5
    )
    as_they_came = transform_points(lidar.base_SE3_lidar, xyz(cloud))
    raw_m = np.minimum(np.abs(as_they_came[:, 0] - 10), np.abs(as_they_came[:, 1] - 4.5))
    assert np.median(raw_m) > 0.3


def test_points_on_a_moving_road_user_are_at_its_past_position() -> None:
    lidar = moving()
    wall = Scene(box_mesh((0.2, 30.0, 6.0), "steel").moved(20.1, 0, 0))
    hits = wall.cast(lidar.rays(np.eye(4), np.zeros(6)))
    hits = replace(hits, objects=np.where(np.isfinite(hits.range_m), 0, -1).astype(np.int32))
    velocity = lidar.base_SE3_lidar[:3, :3].T @ [25.0, 0, 0]
    cloud = lidar.measure(hits, np.random.default_rng(0), [velocity])
    x_m = transform_points(lidar.base_SE3_lidar, xyz(cloud))[:, 0]
    assert np.allclose(x_m, 20.0 + 25.0 * cloud["time"], atol=1e-3)
    assert np.ptp(x_m) > 0.2


def test_without_distortion_motion_has_no_effect() -> None:
    lidar = Lidar(LidarSensor(channels=4, points_per_second=4000, **QUIET))
    assert np.array_equal(lidar.rays(np.eye(4), TWIST), lidar.rays(np.eye(4)))
    count = 100 * 4
    hits = Hits(
        np.full(count, 9.0, np.float32),
        np.ones(count, np.float32),
        np.full(count, 0.2, np.float32),
        np.zeros(count, np.bool_),
        np.ones(count, np.float32),
        np.zeros(count, np.int32),
        np.zeros(1, np.float32),
    )
    cloud = lidar.measure(hits, np.random.default_rng(0), [[30.0, 0, 0]])
    assert not cloud["time"].any()
    assert np.allclose(np.linalg.norm(xyz(cloud), axis=1), 9.0, atol=1e-5)


def test_a_turn_of_several_steps_ends_at_its_last_step() -> None:
    lidar = Lidar(LidarSensor(rotation_frequency=5), step_s=0.05)
    assert [frame for frame in range(9) if lidar.is_due(frame)] == [0, 4, 8]
    assert all(Lidar(LidarSensor(), step_s=0.1).is_due(frame) for frame in range(3))
