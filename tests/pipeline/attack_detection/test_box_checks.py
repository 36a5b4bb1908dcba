"""CARLO and Shadow-Catcher on boxes for which a person can work out the answer."""

import numpy as np
import pytest
from rotating import cloud_of, ranges, rays

from advpipe.pipeline.attack_detection.base import DefenderKnowledge
from advpipe.pipeline.attack_detection.box_frustum import box_frustums
from advpipe.pipeline.attack_detection.carlo import CarloCheck, free_share
from advpipe.pipeline.attack_detection.shadow_catcher import ShadowCatcherCheck, shadow_score
from advpipe.pipeline.detector.protocol import Detections

CUBE = np.array([10.0, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0])
"""Two metres long, from x = 9 to 11 m."""


def frustum(points, box=CUBE):
    (found,) = box_frustums(np.array(points, float), box[None])
    return found


def test_returns_before_in_and_behind_a_box():
    found = frustum([[5, 0, 0], [10, 0.5, 0], [20, 0, 0], [30, 0.1, 0], [10, 5, 0], [-10, 0, 0]])
    assert found.near_m == pytest.approx([9, 9, 9, 9], abs=0.02)
    assert found.far_m == pytest.approx([11, 11, 11, 11], abs=0.02)
    assert found.penetration == 2 / 4


def test_a_turned_box_is_met_by_other_rays():
    points = [[20, 1.9, 0]]
    long = np.array([10.0, 0.0, 0.0, 6.0, 0.2, 2.0, 0.0])
    assert len(frustum(points, long).range_m) == 0
    turned = long.copy()
    turned[6] = np.pi / 2
    assert frustum(points, turned).penetration == 1


def test_a_box_without_returns_lets_nothing_through():
    assert frustum([[-10, 0, 0]]).penetration == 0


def test_free_cells_are_those_that_rays_cross():
    """Of the 8 x 8 x 8 cells, a ray along x crosses one row of eight, and one that returns in the middle
    frees the four before its own."""
    assert free_share(frustum([[20, 0.125, 0.125]])) == pytest.approx(8 / 512, abs=2 / 512)
    assert free_share(frustum([[10.1, 0.125, 0.125]])) == pytest.approx(4 / 512, abs=2 / 512)
    assert free_share(frustum([[5, 0, 0]])) == 0


CAR = np.array([10.0, 0.0, -1.25, 4.0, 2.0, 1.5, 0.0])
"""On the ground 2 m below the sensor, from x = 8 to 12 m."""


def real_car():
    """The cloud of the small sensor, with a car that stops the rays."""
    directions, rings = rays()
    range_m = ranges(directions)
    found = cloud_of(range_m, directions, rings)
    points = np.stack([found[axis] for axis in "xyz"], axis=-1).astype(float)
    row = 0
    (hit,) = box_frustums(points, CAR[None])
    for number, direction in enumerate(directions):
        half, ray = CAR[3:6] / 2, np.where(np.abs(direction) < 1e-12, 1e-12, direction)
        one, other = (CAR[:3] - half) / ray, (CAR[:3] + half) / ray
        near, far = np.minimum(one, other).max(), np.maximum(one, other).min()
        if 0 < near < far:
            range_m[number] = min(range_m[number], near + 0.01)
            row += 1
    assert row == len(hit.range_m) > 10
    return cloud_of(range_m, directions, rings)


def ghost_car():
    """The same box, in which a few added points stand; all rays still return from behind it."""
    directions, rings = rays()
    cloud = cloud_of(ranges(directions), directions, rings)
    added = cloud[:5].copy()
    added["x"], added["y"], added["z"] = 8.1, np.linspace(-0.5, 0.5, 5), -1.0
    return np.concatenate([cloud, added])


ONE_CAR = Detections(CAR[None], np.ones(1), np.zeros(1, np.int64))


def test_carlo_tells_a_ghost_car_from_a_real_one():
    knowledge = DefenderKnowledge([real_car()], detect=lambda cloud: ONE_CAR)
    check = CarloCheck(knowledge)
    real, ghost = (check(cloud, ONE_CAR) for cloud in (real_car(), ghost_car()))
    assert real.score < 1 < ghost.score
    assert ghost.detections.shape == (1,)


def test_shadow_catcher_tells_a_ghost_car_from_a_real_one():
    check = ShadowCatcherCheck(DefenderKnowledge([real_car()]))
    real, ghost = (check(cloud, ONE_CAR) for cloud in (real_car(), ghost_car()))
    assert real.score == 0
    assert ghost.score > 0.1


def test_weight_of_a_return_in_a_shadow():
    """Behind the car from 8 to 12 m, whose top is 0.5 m below the sensor: the shadow ends where the line over
    its top, from 12.04 m, has fallen to 2 m, four times as far."""
    first_m = float(np.hypot(12, 1))
    here = np.array([first_m]), np.array([0.0])

    def score(flat_m, azimuth_rad, height_m=-1.9):
        where = (np.atleast_1d(height_m), np.atleast_1d(flat_m), np.atleast_1d(azimuth_rad))
        return shadow_score(*(np.asarray(each, float) for each in where), CAR, -2.0)

    assert score(*here) == pytest.approx(1)  # at the beginning, in the middle
    assert score(first_m + 0.2 * 3 * first_m, 0.0) == pytest.approx(0.5, abs=0.001)
    assert score(first_m + 0.2 * 3 * first_m, 0.2 * np.arctan2(1, 8)) == pytest.approx(0.25, abs=0.001)
    assert score(4 * first_m + 0.1, 0.0) == 0  # beyond its end
    assert score(first_m, 1.01 * np.arctan2(1, 8)) == 0  # beside it
    assert score(first_m, 0.0, height_m=-0.4) == 0  # above the line over the top
