"""Our checks on small clouds whose answer a person can work out."""

import numpy as np
import pytest
from rotating import COLUMNS, NOTHING, cloud_of, knowledge, ranges, rays, turn

from advpipe.pipeline.attack_detection.base import CheckNotApplicableError, DefenderKnowledge
from advpipe.pipeline.attack_detection.density import DensityCheck
from advpipe.pipeline.attack_detection.occlusion_order import (
    OcclusionOrderCheck,
    farthest_neighbour,
    seen_through,
)
from advpipe.pipeline.attack_detection.range_image import RangeImage, window_sums
from advpipe.pipeline.attack_detection.ray import RayCheck
from advpipe.pipeline.attack_detection.voxel_face import VoxelFaceCheck, face_distance_m
from advpipe.pipeline.detector.protocol import VoxelGrid

GRID = VoxelGrid((-40.0, -40.0, -3.0), (0.1, 0.1, 0.2), (800, 800, 20))


def test_ray_check_counts_points_off_their_rays():
    cloud = turn(1)
    cloud["z"][:10] += np.float32(0.01)
    found = RayCheck(knowledge())(cloud, NOTHING)
    assert np.flatnonzero(found.points).tolist() == list(range(10))
    assert found.score == pytest.approx(10 / len(cloud))


def test_ray_check_needs_rings():
    cloud = turn(1)
    cloud["ring"] = 0
    with pytest.raises(CheckNotApplicableError, match="ring"):
        RayCheck(DefenderKnowledge([cloud]))


def test_distance_to_the_nearest_voxel_face():
    points = np.array([[0.05, 0.05, 0.1], [0.05, 0.099, 0.1], [0.05, 0.05, 0.203], [99, 0, 0]], np.float32)
    assert face_distance_m(points, GRID) == pytest.approx([0.05, 0.001, 0.003, np.inf], abs=1e-5)


def test_voxel_face_check_flags_points_at_faces_and_scores_where_they_crowd():
    rng = np.random.default_rng(0)

    def scattered():
        points = rng.uniform([0, 0, -2.9], [20, 20, 0.9], (5000, 3))
        return cloud_of(np.ones(5000), points, np.zeros(5000))

    check = VoxelFaceCheck(DefenderKnowledge([scattered() for _ in range(3)], GRID))
    clean = scattered()
    # Of 0.1 m, 3 mm lie at a face on two axes; of 0.2 m, 3 mm on the third.
    assert check(clean, NOTHING).points.mean() == pytest.approx(0.03 + 0.03 + 0.015, abs=0.015)
    attacked = clean.copy()
    near = np.flatnonzero((clean["x"] < 5) & (clean["y"] < 5))[:100]
    attacked["x"][near] = np.round(attacked["x"][near] * 10) / 10 + np.float32(0.001)
    found = check(attacked, NOTHING)
    assert found.points[near].all()
    assert found.score > 3 * check(clean, NOTHING).score


def test_voxel_face_check_needs_voxels():
    with pytest.raises(CheckNotApplicableError, match="voxels"):
        VoxelFaceCheck(knowledge())


def test_clean_clouds_have_one_return_a_ray():
    found = OcclusionOrderCheck(knowledge())(turn(1), NOTHING)
    assert (found.score, found.points.any()) == (0, False)


def test_a_second_return_of_a_ray_is_suspicious_with_the_first():
    cloud = turn(1)
    copies = cloud[:2].copy()
    for axis in "xyz":
        copies[axis] *= np.float32(0.5)
    found = OcclusionOrderCheck(knowledge())(np.concatenate([cloud, copies]), NOTHING)
    assert np.flatnonzero(found.points).tolist() == [0, 1, len(cloud), len(cloud) + 1]
    assert found.score == 4


def test_a_return_behind_all_of_its_neighbours_is_suspicious():
    image = np.full((5, 6), 10.0)
    image[2, 3] = 10.6
    assert np.argwhere(seen_through(image)).tolist() == [[2, 3]]
    image[1, 2] = np.nan  # something may stand there
    assert not seen_through(image).any()
    image[1, 2] = 10.2  # nearer than it by less than half a metre
    assert not seen_through(image).any()


def test_the_farthest_neighbour_that_returns():
    image = np.full((3, 6), np.nan)
    image[1, 2], image[0, 3] = 8.0, 12.0
    found = farthest_neighbour(image)
    assert (found[1, 1], found[1, 3], found[2, 3], found[1, 5]) == (8, 12, 8, np.inf)


def test_windows_go_round_the_turn():
    values = np.zeros((4, 6))
    values[0, 0] = 1
    assert window_sums(values, 3, 3).tolist() == [
        [1, 1, 0, 0, 0, 1],
        [1, 1, 0, 0, 0, 1],
        [0] * 6,
        [0] * 6,
    ]


def test_range_image_holds_the_nearest_return():
    directions, rings = rays()
    cloud = cloud_of(ranges(directions), directions, rings, intensity=0.25)
    nearer = cloud[:1].copy()
    for axis in "xyz":
        nearer[axis] *= np.float32(0.5)
    nearer["intensity"] = 1
    image = RangeImage.of(np.concatenate([cloud, nearer]), knowledge().sensor)
    assert image.count.sum() == len(cloud) + 1
    assert image.ray[0] == image.ray[-1]
    assert image.range_m.flat[image.ray[0]] == pytest.approx(ranges(directions)[0] / 2)
    assert image.intensity.flat[image.ray[0]] == 1


def test_density_check_sees_a_hole_and_not_the_usual_losses():
    check = DensityCheck(knowledge(turns=8))
    clean = [check(turn(seed), NOTHING).score for seed in range(20)]
    holes = []
    for seed in range(20):
        cloud = turn(seed)
        column = np.rint(np.arctan2(cloud["y"], cloud["x"]) * COLUMNS / (2 * np.pi))
        holes.append(check(cloud[(np.abs(column) > 4) | (cloud["ring"] > 4)], NOTHING).score)
    assert min(holes) > 1.2 * max(clean)
    assert check(turn(0), NOTHING).points is None
