"""Ranges on a plane and a box agree with numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw, transform_points
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.stages.simulate.world.raycast.materials import MATERIALS
from advpipe.stages.simulate.world.raycast.mesh import box_mesh, merge, surface
from advpipe.stages.simulate.world.raycast.scene import Scene

PLANE = surface(
    [[-200, -200, 0], [200, -200, 0], [200, 200, 0], [-200, 200, 0]], [[0, 1, 2], [0, 2, 3]], "asphalt"
)
QUIET = {
    "noise_stddev": 0.0,
    "dropoff_general_rate": 0.0,
    "dropoff_intensity_limit": 0.0,
    "imperfections": IDEAL,
}


def sweep(sensor: LidarSensor, scene: Scene, yaw_rad: float = 0.0) -> np.ndarray:
    lidar = Lidar(sensor)
    return lidar.measure(scene.cast(lidar.rays(se3_from_yaw((0, 0, 0), yaw_rad))), np.random.default_rng(0))


def test_the_range_of_a_plane_follows_from_the_angle() -> None:
    sensor = LidarSensor(
        channels=3,
        lower_fov=-45,
        upper_fov=-15,
        points_per_second=3 * 8 * 10,
        atmosphere_attenuation_rate=0,
        **QUIET,
    )
    cloud = sweep(sensor, Scene(PLANE))
    assert len(cloud) == 3 * 8
    assert np.allclose(cloud["z"], -1.8, atol=1e-5)
    horizontal = np.hypot(cloud["x"], cloud["y"])
    # 1.8 m above the ground: tan 45, tan 30 and tan 15 degrees down.
    for ring, expected_m in enumerate([1.8, 1.8 / 0.57735027, 1.8 / 0.26794919]):
        assert np.allclose(horizontal[cloud["ring"] == ring], expected_m, atol=1e-4)
    # Intensity: reflectivity x (cos + 0.2993 sin^2) of the angle of incidence; 45 degrees on the first ring.
    # Oren-Nayar, 20 degrees: A = 1 - 0.5 x 0.12185/0.45185 = 0.86517, B = 0.45 x 0.12185/0.21185 = 0.25883.
    expected = MATERIALS["asphalt"] * (0.70710678 + 0.25883 / 0.86517 * 0.5)
    assert np.allclose(cloud["intensity"][cloud["ring"] == 0], expected, atol=1e-5)


def test_a_box_ahead_is_hit_on_its_near_face() -> None:
    sensor = LidarSensor(channels=1, lower_fov=0, upper_fov=1, points_per_second=4 * 10, **QUIET)
    crate = box_mesh((2.0, 3.0, 4.0), "steel").moved(11.0, 0.0, 0.0)
    cloud = sweep(sensor, Scene(crate))
    assert len(cloud) == 1
    assert cloud["x"][0] == pytest.approx(10.0, abs=1e-5)
    turned = sweep(sensor, Scene(crate), yaw_rad=np.pi / 2)  # now the box lies to the right
    assert turned["y"][0] == pytest.approx(-10.0, abs=1e-5)


def test_intensity_fades_by_the_attenuation_rate() -> None:
    sensor = LidarSensor(
        channels=1, lower_fov=0, upper_fov=1, points_per_second=40, atmosphere_attenuation_rate=0.02, **QUIET
    )
    near, far = (
        sweep(sensor, Scene(box_mesh((2.0, 9.0, 9.0), "steel").moved(x, 0, 0)))["intensity"][0]
        for x in (11.0, 51.0)
    )
    assert far / near == pytest.approx(np.exp(-0.02 * 40.0), rel=1e-4)


def test_noise_and_loss_have_the_configured_size() -> None:
    noisy = LidarSensor(
        channels=8, lower_fov=-30, upper_fov=-10, points_per_second=8 * 10 * 2000, noise_stddev=0.05,
        dropoff_general_rate=0.25, dropoff_intensity_limit=0.0, imperfections=IDEAL,
    )  # fmt: skip
    cloud = sweep(noisy, Scene(PLANE))
    assert len(cloud) == pytest.approx(0.75 * 16000, rel=0.02)
    elevation = np.deg2rad(np.linspace(-30, -10, 8))[cloud["ring"]]
    true_range_m = 1.8 / -np.sin(elevation)
    measured_m = np.sqrt(cloud["x"] ** 2 + cloud["y"] ** 2 + cloud["z"] ** 2)
    assert np.std(measured_m - true_range_m) == pytest.approx(0.05, rel=0.05)
    assert abs(np.mean(measured_m - true_range_m)) < 0.003


def test_points_on_a_box_decrease_with_range_by_geometry() -> None:
    sensor = LidarSensor(channels=64, **QUIET)
    counts = []
    for distance_m in (10.0, 20.0, 40.0):
        wall = box_mesh((0.1, 4.0, 3.6), "steel").moved(distance_m + 0.05, 0, 0)
        cloud = sweep(sensor, Scene(wall))
        # Azimuth steps of 0.2 degrees across 4 m; elevation steps of 26.8 / 63 degrees over 3.6 m.
        columns = 2 * np.rad2deg(np.arctan(2.0 / distance_m)) / 0.2
        angles = np.rad2deg(np.arctan([1.8 / distance_m, 1.8 / distance_m]))
        rows = (min(angles[0], 2.0) + min(angles[1], 24.8)) / (26.8 / 63)
        assert len(cloud) == pytest.approx(columns * rows, rel=0.15)
        counts.append(len(cloud))
    assert counts[0] > counts[1] > counts[2]


def test_no_point_is_outside_the_sensors_range() -> None:
    sensor = LidarSensor(range=30, **QUIET)
    cloud = sweep(sensor, Scene(merge([PLANE, box_mesh((0.2, 0.2, 1.9), "steel").moved(0.4, 0, 0)])))
    range_m = np.linalg.norm(np.stack([cloud["x"], cloud["y"], cloud["z"]]), axis=0)
    assert range_m.max() <= 30.001
    assert range_m.min() >= 0.9


def test_rays_start_at_the_mounting_position() -> None:
    lidar = Lidar(LidarSensor(x_m=0.5, z_m=2.0, channels=1, upper_fov=1, lower_fov=0, points_per_second=40))
    map_SE3_base = se3_from_yaw((10, 20, 1), np.pi / 2)
    rays = lidar.rays(map_SE3_base)
    assert np.allclose(rays[:, :3], transform_points(map_SE3_base, [0.5, 0, 2.0]), atol=1e-5)
    assert np.allclose(rays[:, :3], [10, 20.5, 3], atol=1e-5)
    assert np.allclose(np.linalg.norm(rays[:, 3:], axis=1), 1, atol=1e-6)
