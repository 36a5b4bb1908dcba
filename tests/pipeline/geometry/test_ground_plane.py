"""The plane of the ground in synthetic clouds: tilted, sloping ahead, beside walls and kerbs, or missing."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.ground_plane import GroundPlane, fit_ground
from advpipe.pipeline.geometry.transforms import transform_points

HEIGHT_M = 1.8


def rings(height_m: float = HEIGHT_M, channels: int = 32, columns: int = 720) -> np.ndarray:
    """Where the rays of a level LiDAR meet flat ground, with a range noise of 1 cm."""
    draw = np.random.default_rng(3)
    down_rad = np.radians(np.linspace(2.0, 25.0, channels))
    turn_rad = np.linspace(-np.pi, np.pi, columns, endpoint=False)
    range_m = (height_m / np.tan(down_rad))[:, None] + draw.normal(0, 0.01, (channels, columns))
    x, y = range_m * np.cos(turn_rad), range_m * np.sin(turn_rad)
    return np.stack([x, y, np.full_like(x, -height_m)], axis=-1).reshape(-1, 3)


def fitted(points: np.ndarray) -> GroundPlane:
    plane = fit_ground(points.astype(np.float32))
    assert isinstance(plane, GroundPlane), plane
    return plane


def assert_near(plane: GroundPlane, height_m: float = HEIGHT_M, slope: tuple[float, float] = (0, 0)) -> None:
    assert plane.height_m == pytest.approx(height_m, abs=0.01)
    assert np.degrees(np.hypot(plane.slope_x - slope[0], plane.slope_y - slope[1])) < 0.2


def wall(x_m: float, top_m: float = 6.0) -> np.ndarray:
    y, z = np.meshgrid(np.linspace(-30, 30, 400), np.linspace(-HEIGHT_M, top_m, 60))
    return np.stack([np.full_like(y, x_m), y, z], axis=-1).reshape(-1, 3)


def test_flat_ground() -> None:
    assert_near(fitted(rings()))
    assert_near(fitted(rings(2.2)), 2.2)


@pytest.mark.parametrize("slope", [(0.05, 0.0), (-0.03, 0.06), (0.12, -0.12)])
def test_a_tilted_lidar(slope: tuple[float, float]) -> None:
    points = rings()
    points[:, 2] += points[:, :2] @ slope
    plane = fitted(points)
    assert_near(plane, HEIGHT_M / np.sqrt(1 + slope[0] ** 2 + slope[1] ** 2), slope)
    level = transform_points(plane.level_SE3_lidar(), points)
    assert np.abs(level[:, 2] + plane.height_m).max() < 0.02
    rotation = plane.level_SE3_lidar()[:3, :3]
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.degrees(np.arctan2(rotation[1, 0], rotation[0, 0])) == pytest.approx(0, abs=0.5)  # no yaw


@pytest.mark.parametrize("grade", [0.06, -0.08])
def test_a_slope_that_begins_ahead_does_not_tilt_it(grade: float) -> None:
    points = rings()
    points[:, 2] += grade * np.maximum(points[:, 0] - 12.0, 0.0)
    assert_near(fitted(points))


def test_a_street_between_pavements_walls_and_cars() -> None:
    draw = np.random.default_rng(4)
    points = rings()
    points[:, 2] += np.where(np.abs(points[:, 1]) > 4.0, 0.12, 0.0)  # pavements
    points[:, 2] += np.where(np.abs(points[:, 1]) > 9.0, -0.2, 0.0)  # verges
    points = points[np.abs(points[:, 1]) < 15.0]
    cars = draw.uniform((-20, 2.0, -1.5), (20, 3.8, -0.3), (4000, 3))
    hidden = (points[:, 1] > 2.0) & (points[:, 1] < 3.8) & (draw.random(len(points)) < 0.5)
    scene = np.concatenate([points[~hidden], cars, wall(18.0), wall(-25.0)])
    assert_near(fitted(scene))


def test_points_below_the_ground_and_without_a_return() -> None:
    points = rings()
    draw = np.random.default_rng(5)
    mirrored = draw.uniform((-15, -15, -4), (15, 15, -2.5), (150, 3))
    missing = np.full((50, 3), np.nan)
    assert_near(fitted(np.concatenate([points, mirrored, missing])))


def test_a_cloud_of_the_front_alone() -> None:
    points = rings()
    assert_near(fitted(points[np.abs(np.arctan2(points[:, 1], points[:, 0])) < np.radians(45)]))


def test_the_same_cloud_has_the_same_plane() -> None:
    points = rings()
    assert fit_ground(points) == fit_ground(points.copy())


def test_the_level_vertical_axis_is_the_normal() -> None:
    plane = GroundPlane(0.1, -0.2, 1.8)
    assert plane.level_SE3_lidar()[:3, :3] @ plane.normal == pytest.approx([0, 0, 1])
    assert GroundPlane(0.0, 0.0, 1.8).level_SE3_lidar() == pytest.approx(np.eye(4))


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (np.zeros((0, 3)), "only 0 of"),
        (np.full((100, 3), np.nan), "only 0 of"),
        (rings()[:20], "only"),
        (np.random.default_rng(0).uniform(-30, 30, (5000, 3)) * (1, 1, 0.25), "no plane|cells of the ground"),
        (rings(0.2, channels=8), "only|no plane"),
        (wall(10.0), "no plane|only|strip"),
        (rings()[np.abs(rings()[:, 1]) < 0.6], "only|strip"),
    ],
)
def test_clouds_without_ground_are_told(points: np.ndarray, reason: str) -> None:
    found = fit_ground(points)
    assert isinstance(found, str)
    assert any(part in found for part in reason.split("|")), found
