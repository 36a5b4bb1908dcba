"""Shadows of boxes, against slabs."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import invert, se3_from_yaw, transform_points
from advpipe.stages.simulate.world.raycast.sun_shadows import SunShadows

SUNS = [(0.3, -0.4, 0.866), (0.0, 0.0, 1.0), (-0.99, 0.1, 0.1)]


@pytest.mark.parametrize("sun", SUNS)
def test_every_point_in_the_shadow_of_a_box_is_found(sun: tuple[float, float, float]) -> None:
    rng, towards = np.random.default_rng(0), np.array(sun) / np.linalg.norm(sun)
    poses = [se3_from_yaw((*rng.uniform(950, 1050, 2), 1.0), rng.uniform(-3, 3)) for _ in range(30)]
    half_m = rng.uniform(0.3, [4, 1.5, 2], (30, 3))
    points_m = np.stack([*rng.uniform(940, 1060, (2, 20_000)), rng.uniform(-1, 2, 20_000)])
    shadows = SunShadows(np.array(poses), half_m, towards.astype(np.float32))
    pairs = shadows.pairs(points_m.astype(np.float32))
    found = set(zip(*(index.tolist() for index in pairs), strict=True))
    met = 0
    for index, (pose, half) in enumerate(zip(poses, half_m, strict=True)):
        origin, direction = transform_points(invert(pose), points_m.T), towards @ pose[:3, :3]
        with np.errstate(divide="ignore"):
            slabs = np.stack([(side * half - origin) / direction for side in (-1, 1)])
        enter, leave = slabs.min(axis=0).max(axis=1), slabs.max(axis=0).min(axis=1)
        shaded = np.flatnonzero((enter <= leave) & (leave > 0))
        met += len(shaded)
        assert {(point, index) for point in shaded.tolist()} <= found
    assert 300 < met < len(found) < 0.1 * points_m.shape[1] * len(poses)


def test_nothing_shades_where_nothing_stands() -> None:
    shadows = SunShadows(np.zeros((0, 4, 4)), np.zeros((0, 3)), np.array([0, 0, 1], np.float32))
    points, boxes = shadows.pairs(np.zeros((3, 4), np.float32))
    assert len(points) == len(boxes) == 0
