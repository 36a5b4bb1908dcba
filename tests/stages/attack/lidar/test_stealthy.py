"""The recipe stealthy: what it changes passes the checks that an evaluation runs."""

from __future__ import annotations

import numpy as np
import pytest
from cloud_moves import rng
from scipy.spatial import cKDTree

from advpipe.pipeline.adversary.missing_returns import MissingReturnLimit
from advpipe.pipeline.attack_detection.density import QUANTILE, LossModel
from advpipe.pipeline.attack_detection.range_image import RangeImage
from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.attack_detection.voxel_face import AT_FACE_M, face_distance_m
from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.crossings import MIN_DEPTH_M, find_crossings
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import ON_RAY_URAD, Perturb
from advpipe.stages.attack.lidar.result_checks import refuse_invalid, refuse_out_of_bounds
from advpipe.stages.attack.lidar.stealthy import NO_RINGS

COLUMNS, RINGS = 360, 16


@pytest.fixture
def turn(make_cloud):
    """A turn of a LiDAR of 16 rings 5 m from everything; a tenth of the returns is lost."""
    draw = np.random.default_rng(4)
    azimuth, ring = np.meshgrid(2 * np.pi * np.arange(COLUMNS) / COLUMNS, np.arange(RINGS), indexing="ij")
    elevation = np.deg2rad(5 + 2.5 * ring)
    range_m = draw.uniform(4.9, 5.1, ring.shape)
    flat_m = range_m * np.cos(elevation)
    places = [flat_m * np.cos(azimuth), flat_m * np.sin(azimuth), range_m * np.sin(elevation)]
    cloud = make_cloud(np.stack(places, axis=-1).reshape(-1, 3))
    cloud["ring"], cloud["intensity"] = ring.ravel(), draw.uniform(0.2, 0.4, ring.size)
    return cloud[draw.random(len(cloud)) > 0.1]


@pytest.fixture
def stealth_scene(turn, make_boxes, make_detector):
    """A car for which every voxel of 1 m speaks that holds a point, and every empty one against it."""
    box = [3.0, 3.0, 3.0, 6.0, 6.0, 6.0, 0.0]
    weights = np.full((10, 10, 10), -1.0)
    points = xyz(turn)
    weights[tuple(np.floor(points[(points >= 0).all(axis=1)]).astype(int).T)] = 0.3
    return turn, make_boxes(box), make_detector(weights, [box])


def attacked(attack, scene):
    result = attack(*scene, rng())
    refuse_invalid("stealthy", scene[0], result)
    refuse_out_of_bounds("stealthy", attack, scene[0], result)
    assert len(result.labels)
    assert result.loss_after > result.loss_before
    return result


def test_perturbed_points_stay_on_their_rays(stealth_scene):
    attack = Perturb(eps_cm=60, recipe="stealthy")
    result = attacked(attack, stealth_scene)
    assert attack.bounds["max_off_ray_urad"] == (0, ON_RAY_URAD)
    assert not SensorGeometry.learnt([stealth_scene[0]]).off_ray(result.cloud).any()


def test_a_point_off_its_ray_is_beyond_the_bounds(stealth_scene):
    attack, free = (Perturb(eps_cm=60, recipe=name) for name in ("stealthy", "random-near"))
    with pytest.raises(Exception, match="max_off_ray_urad"):
        refuse_out_of_bounds("stealthy", attack, stealth_scene[0], free(*stealth_scene, rng()))


def test_added_points_have_rays_of_their_own(stealth_scene):
    cloud = stealth_scene[0]
    result = attacked(Attach(eps_m=0.5, points=40, recipe="stealthy"), stealth_scene)
    sensor = SensorGeometry.learnt([cloud])
    assert RangeImage.of(cloud, sensor).count.max() == 1
    assert RangeImage.of(result.cloud, sensor).count.max() == 1
    assert not sensor.off_ray(result.cloud).any()  # in the ring that they state, too
    added = result.cloud[len(cloud) :]
    assert 0 < len(added) <= 40
    distance_m, _ = cKDTree(xyz(cloud).astype(float)).query(xyz(added).astype(float))
    assert (distance_m <= 0.5).all()


def test_removed_points_leave_the_score_as_it_is(stealth_scene):
    cloud = stealth_scene[0]
    stealthy, best = (
        attacked(Detach(ratio=0.03, recipe=name), stealth_scene) for name in ("stealthy", "best")
    )
    sensor = SensorGeometry.learnt([cloud])
    clean = RangeImage.of(cloud, sensor)
    model = LossModel.learnt([clean])

    def score(image):
        return np.quantile(model.excess(image), QUANTILE)

    assert score(RangeImage.of(stealthy.cloud, sensor)) <= 1.1 * score(clean)
    assert score(RangeImage.of(best.cloud, sensor)) > 1.5 * score(clean)


def test_the_limit_takes_no_group_of_which_one_point_is_too_much(turn):
    limit = MissingReturnLimit(turn, SensorGeometry.learnt([turn]))
    together = np.flatnonzero((turn["ring"] < 3) & (np.arctan2(turn["y"], turn["x"]) < 0.1))[-30:]
    one_by_one = [point for point in together if limit.take(np.array([point]))]
    assert 0 < len(one_by_one) < 30
    limit.start(np.zeros(0, np.int64))
    assert not limit.take(together)
    assert [point for point in together if limit.take(np.array([point]))] == one_by_one  # nothing was taken


@pytest.mark.parametrize(
    "attack", [Attach(eps_m=0.5, recipe="stealthy"), Detach(ratio=0.1, recipe="stealthy")]
)
def test_a_cloud_without_rings_is_left_alone(attack, stealth_scene):
    cloud = stealth_scene[0].copy()
    cloud["ring"] = 0
    result = attack(cloud, *stealth_scene[1:], rng())
    assert result.cloud.tobytes() == cloud.tobytes()
    assert NO_RINGS in result.note


def test_points_spread_in_the_voxels_that_they_enter():
    grid = VoxelGrid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (100, 100, 100))
    start = np.random.default_rng(0).uniform(2, 8, (4000, 3)).astype(np.float32)
    found = find_crossings(start, grid, 0.1, 0.001, True, None, rng())
    moves = found.length_m > 0
    places = start[found.point[moves]] + found.offset_m[moves]
    past_m = np.mod(places, 0.1)
    at_face = (np.minimum(past_m, 0.1 - past_m) < 0.0015).any(axis=1).mean()
    by_chance = 1 - 0.97**3
    assert at_face < 2 * by_chance
    assert (found.length_m <= 0.1).all()
    crowded = find_crossings(start, grid, 0.1, 0.001, True)
    there = start[crowded.point] + crowded.offset_m
    past_m = np.mod(there[crowded.length_m > 0], 0.1)
    assert (np.minimum(past_m, 0.1 - past_m) < 0.0015).any(axis=1).mean() > 0.9
    assert MIN_DEPTH_M < 0.1


@pytest.mark.parametrize("reach_m", [0.03, 0.1])
def test_points_come_to_faces_no_oftener_than_they_lay_there(reach_m):
    """Even where their reach ends just behind a face."""
    draw = np.random.default_rng(7)
    grid = VoxelGrid((0.0, 0.0, 0.0), (0.1, 0.1, 0.2), (100, 100, 50))
    start = draw.uniform(1, 9, (30_000, 3)).astype(np.float32)
    ways = find_crossings(start, grid, reach_m, 0.01, along_ray=True, spread=draw)
    moves = np.flatnonzero(ways.offset_m.any(axis=1))
    arrived = (start[ways.point[moves]] + ways.offset_m[moves]).astype(np.float32)
    before, after = (float((face_distance_m(each, grid) <= AT_FACE_M).mean()) for each in (start, arrived))
    assert len(moves) > 3_000
    assert after == pytest.approx(before, abs=4 * np.sqrt(before / len(moves)))
