"""CARLO and Shadow-Catcher on boxes for which a person can work out the answer."""

from dataclasses import replace

import numpy as np
import pytest
from rotating import cloud_of, ranges, rays

from advpipe.pipeline.attack_detection.base import DefenderKnowledge
from advpipe.pipeline.attack_detection.box_frustum import box_frustums
from advpipe.pipeline.attack_detection.carlo import CarloCheck, CarloLimits, free_share
from advpipe.pipeline.attack_detection.shadow_catcher import ShadowCatcherCheck, best_threshold
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
    check = CarloCheck(DefenderKnowledge([real_car()], detect=lambda cloud: ONE_CAR))
    real, ghost = (check(cloud, ONE_CAR) for cloud in (real_car(), ghost_car()))
    assert real.score < 1 < ghost.score
    assert ghost.detections.shape == (1,)
    assert (real.fake.tolist(), ghost.fake.tolist()) == ([False], [True])


def test_carlo_judges_vehicles_alone():
    check = CarloCheck(DefenderKnowledge([real_car()], detect=lambda cloud: ONE_CAR))
    someone = replace(ONE_CAR, labels=np.array([3]))
    assert check(ghost_car(), someone).score == 0
    assert not check(ghost_car(), someone).fake.any()


def test_carlo_without_vehicles_in_clean_clouds_decides_nothing():
    check = CarloCheck(DefenderKnowledge([real_car()]))
    assert check(ghost_car(), ONE_CAR).fake is None
    assert check(ghost_car(), ONE_CAR).score > check(real_car(), ONE_CAR).score


def rays_through(behind, inside):
    """So many returns behind the cube, and so many in its middle."""
    return frustum([[20, 0.125, 0.125]] * behind + [[10.1, 0.125, 0.125]] * inside)


def test_limits_of_algorithm_1():
    """Valid cubes let 0 and 1 of 4 rays through, spoofed ones 3 and 4 of 4: b' is nearly 1/4, a' 3/4. f is 8
    of 512 cells where a ray passes without a return in its row, else 3, as far as the fifth is occupied."""
    valid = [rays_through(0, 4), rays_through(1, 3)]
    spoofed = [rays_through(3, 1), rays_through(4, 0)]
    limits = CarloLimits.fitted(valid, spoofed)
    assert (limits.b_prime, limits.a_prime) == pytest.approx((0.25, 0.75), abs=0.002)
    assert limits.score(rays_through(1, 3)) == (0.0, False)  # .25 < .75 - .05
    assert limits.score(rays_through(4, 0)) == (2.0, True)  # 1 > .25 + .05
    assert CarloLimits.fitted(valid, []) is None


def test_free_space_decides_where_penetration_does_not():
    limits = CarloLimits(a_prime=0.4, b_prime=0.6, a=0.01, b=0.005)
    undecided = rays_through(2, 2)
    score, fake = limits.score(undecided)
    assert score == free_share(undecided) == pytest.approx(7 / 512, abs=2 / 512)
    assert fake  # above .0075
    assert replace(limits, a=0.1).score(undecided) == (score, False)  # below .0525


def test_shadow_catcher_tells_a_ghost_car_from_a_real_one():
    check = ShadowCatcherCheck(DefenderKnowledge([real_car()], detect=lambda cloud: ONE_CAR))
    real, ghost = (check(cloud, ONE_CAR) for cloud in (real_car(), ghost_car()))
    assert real.score == 0
    assert ghost.score > 0.1
    assert (real.fake.tolist(), ghost.fake.tolist()) == ([False], [True])


def test_shadow_catcher_without_detections_in_clean_clouds_decides_nothing():
    check = ShadowCatcherCheck(DefenderKnowledge([real_car()]))
    assert check(ghost_car(), ONE_CAR).fake is None


def test_the_threshold_with_the_fewest_errors():
    """At .3, one of four genuine scores is above, and all of three ghosts."""
    assert best_threshold(np.array([0.0, 0.1, 0.3, 0.5]), np.array([0.4, 0.6, 0.9])) == 0.3
    assert best_threshold(np.array([0.2]), np.zeros(0)) == np.inf
