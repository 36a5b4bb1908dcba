from __future__ import annotations

import numpy as np
import pytest
import torch
from cloud_moves import rng
from linear_detector import LinearVoxelDetector
from scipy.spatial import cKDTree

from advpipe.pipeline.adversary.constraints import BLACK_BOX, Constraints, Rules
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import xyz, xyzi
from advpipe.stages.attack.lidar.attach import RECIPES as EVERY_RECIPE
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.attach_places import voxel_places

RECIPES = tuple(name for name in EVERY_RECIPE if name not in ("stealthy", *BLACK_BOX))
"""Those that need no rings; the others are in `test_stealthy`."""

CHANCE = ("random", "random-near", "random-best")


def scene_of(make_cloud, make_boxes, make_detector, points=300):
    """A car in a cloud that fills about a quarter of the voxels; some of the empty ones speak against it."""
    draw = np.random.default_rng(3)
    cloud = make_cloud(draw.uniform(0, 10, (points, 3)))
    cloud["intensity"], cloud["ring"] = draw.random(points), draw.integers(0, 64, points)
    box = [3.0, 3.0, 3.0, 6.0, 6.0, 6.0, 0.0]
    weights = draw.choice([-1.0, 0.6], (10, 10, 10))
    return cloud, make_boxes(box), make_detector(weights, [box])


def test_best_fills_the_one_voxel_that_hurts(make_cloud, make_boxes):
    # Voxels (0, 0, 0) and (2, 0, 0) are occupied. An occupied (1, 0, 0) would count -5; (3, 0, 0) -9, but
    # it lies 0.8 m off, beyond reach. The place is 0.102 m from the first point, 0.202 m from the others.
    box = [2.5, 0.5, 0.5, 5.0, 1.0, 1.0, 0.0]
    weights = np.zeros((10, 10, 10))
    weights[0, 0, 0], weights[1, 0, 0], weights[3, 0, 0] = 1.0, -5.0, -9.0
    cloud = make_cloud([[0.9, 0.5, 0.5]] + [[2.2, 0.5, 0.5]] * 5)
    detector = LinearVoxelDetector(weights, [box])
    result = Attach(eps_m=0.5, points=1)(cloud, make_boxes(box), detector, rng())
    assert xyz(result.cloud[6:]) == pytest.approx(np.array([[1.002, 0.5, 0.5]]))
    assert result.labels.displacement_m == pytest.approx([0.102], abs=1e-6)
    assert result.loss_after - result.loss_before == pytest.approx(5 * 1.01002, rel=1e-5)
    assert len(detector.detect(cloud)) == 1
    assert len(detector.detect(result.cloud)) == 0


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize(("eps_m", "points"), [(0.05, 10), (0.3, 1), (0.3, 60), (1.0, 7)])
def test_exactly_the_points_within_eps(make_cloud, make_boxes, make_detector, recipe, eps_m, points):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)
    result = Attach(eps_m=eps_m, points=points, recipe=recipe)(cloud, boxes, detector, rng())
    assert result.cloud[:300].tobytes() == cloud.tobytes()
    added = result.cloud[300:]
    assert len(added) == len(result.labels) == points
    distance, _ = cKDTree(xyz(cloud).astype(np.float64)).query(xyz(added).astype(np.float64))
    assert (distance <= eps_m).all()
    assert result.labels.displacement_m == pytest.approx(distance)
    assert (result.labels.point == -1).all()
    assert (result.labels.action == "added").all()
    assert not np.isin(added["intensity"], cloud["intensity"]).any()  # none of the cloud's occurs twice
    assert cloud["intensity"].min() <= added["intensity"].min()
    assert added["intensity"].max() <= cloud["intensity"].max()


def test_each_recipe_is_stronger_than_a_random_one(make_cloud, make_boxes, make_detector):
    scene = scene_of(make_cloud, make_boxes, make_detector)
    after = {name: Attach(eps_m=0.5, points=20, recipe=name)(*scene, rng()).loss_after for name in RECIPES}
    for name in ("best", "robust"):
        assert after[name] > max(after[chance] for chance in CHANCE) + 1


def test_paper_shifts_copies_up_the_gradient(hand_worked):
    # The loss is -sum of weight * (1 + mean x / 100): to raise it, points of positive weight go to lower x.
    # C's two points (the 5th and 6th) have the largest gradients, .045 each; B's have .02.
    cloud, boxes, detector = hand_worked
    result = Attach(eps_m=0.05, points=2, recipe="paper")(cloud, boxes, detector, rng())
    moved = xyz(result.cloud[len(cloud) :])
    assert sorted(moved[:, 0]) == pytest.approx([2.35, 2.55], abs=1e-6)
    assert moved[:, 1:] == pytest.approx(np.full((2, 2), 0.5))


def test_chamfer_weight_holds_copies_back(hand_worked):
    cloud, boxes, detector = hand_worked
    far, near = (
        Attach(eps_m=0.05, points=2, recipe="paper", weight=weight)(cloud, boxes, detector, rng())
        for weight in (0.0, 1e3)
    )
    assert near.labels.displacement_m.max() < 0.5 * far.labels.displacement_m.max()


def test_small_decay_stays_closer(make_cloud, make_boxes, make_detector):
    scene = scene_of(make_cloud, make_boxes, make_detector)
    wide, close = (
        Attach(eps_m=1.0, points=20, decay_m=decay)(*scene, rng()).labels.displacement_m.mean()
        for decay in (100.0, 0.1)
    )
    assert close < wide


def test_robust_stays_clear_of_the_faces(make_cloud, make_boxes, make_detector):
    scene = scene_of(make_cloud, make_boxes, make_detector)
    result = Attach(eps_m=0.5, points=10, recipe="robust")(*scene, rng())
    assert "random" not in result.note
    inside = xyz(result.cloud[300:]) % 1
    assert (np.minimum(inside, 1 - inside) > 0.0249).all()


def test_ghost_object_appears(make_cloud, make_boxes):
    """A box that scores where voxels of weight 0.2 fill, in a cloud of the ground alone."""
    ground = make_cloud([[x + 0.5, y + 0.5, 0.9] for x in range(10) for y in range(10)])
    box = [5.0, 5.0, 0.9 + 1.55 / 2, 4.5, 1.85, 1.55, 0.0]  # where Ghost puts a car on this ground
    weights = np.zeros((10, 10, 10))
    weights[:, :, 1] = 0.2
    detector = LinearVoxelDetector(weights, [box])
    assert len(detector.detect(ground)) == 0
    result = Attach(eps_m=0.5, points=6, ghost="car:5:5")(ground, make_boxes(), detector, rng())
    assert len(result.labels) == 6
    assert len(detector.detect(result.cloud)) == 1
    bare = ground[ground["x"] < 3]
    nowhere = Attach(eps_m=0.5, ghost="car:8:5")(bare, make_boxes(), detector, rng())
    assert (len(nowhere.labels), nowhere.note) == (0, "no ground for the ghost to stand on")


@pytest.mark.parametrize(
    ("ghost", "line"),
    [
        ("car:50:5", r"\(50, 5\) m lies outside of the detector's range, x 0 to 10 m and y 0 to 10 m"),
        ("cyclist:5:5", "the detector finds no cyclist; it finds car"),
    ],
)
def test_a_ghost_object_that_no_detector_finds_is_refused(make_cloud, make_boxes, make_detector, ghost, line):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)
    with pytest.raises(AdvpipeError, match=line):
        Attach(eps_m=0.5, ghost=ghost)(cloud, boxes, detector, rng())


def test_objects_that_are_not_there_are_reported(make_cloud, make_boxes, make_detector):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)
    some = Attach(eps_m=0.5, points=12, objects=("car0", "bus7"))(cloud, boxes, detector, rng())
    assert (len(some.labels), some.note) == (12, "not in the ground truth: bus7")
    near = Attach(eps_m=0.5, points=12, recipe="random-near", objects=("car0", "bus7"))
    some = near(cloud, boxes, detector, rng())
    assert (len(some.labels), some.note) == (12, "not in the ground truth: bus7")
    none = Attach(eps_m=0.5, points=12, objects=("bus7",))(cloud, boxes, detector, rng())
    assert len(none.labels) == 0
    assert none.note == "not in the ground truth: bus7; no object to hide that the detector could find"


@pytest.mark.parametrize("recipe", RECIPES)
def test_constraints_hold(make_cloud, make_boxes, make_detector, recipe):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)
    options = {"along_ray": True, "keep_occlusion_order": True, "near_objects_m": 0.2}
    result = Attach(eps_m=0.5, points=12, recipe=recipe, **options)(cloud, boxes, detector, rng())
    added = xyz(result.cloud[300:]).astype(np.float64)
    assert len(added) == 12
    rays = xyz(cloud).astype(np.float64)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    unit = added / np.linalg.norm(added, axis=1, keepdims=True)
    assert (cKDTree(rays).query(unit)[0] < 1e-5).all()
    assert (added <= 6.2).all()
    assert not Rules(Constraints(), xyz(cloud), boxes).hidden(added).any()


def test_intensity_is_attacked_on_demand(make_cloud, make_boxes):
    class Bright(LinearVoxelDetector):
        """Also sees by how bright the points are: each adds its intensity to the score."""

        def _scores(self, points, boxes, probes):
            scores, occupancy, voxel = super()._scores(points, boxes, probes)
            return scores + 0.1 * points[:, 3].sum(), occupancy, voxel

    cloud, boxes, detector = scene_of(make_cloud, make_boxes, Bright)
    detector.weights = detector.weights.clamp(min=0.01)  # nothing to gain by places
    free = Attach(eps_m=0.5, points=20, intensity=True)(cloud, boxes, detector, rng())
    left = Attach(eps_m=0.5, points=20)(cloud, boxes, detector, rng())
    assert (free.cloud["intensity"][300:] == 0).all()
    assert (left.cloud["intensity"][300:] > 0).all()


def test_places_are_one_in_each_empty_voxel_in_reach(make_cloud, make_boxes, make_detector):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)
    grid, rules = detector.voxel_grid, Rules(Constraints(), xyz(cloud), boxes)
    places = voxel_places(xyzi(cloud), boxes.geometry, grid, rules, 0.7, 0.5, 0.002)
    keys = grid.keys(grid.cells(places.points))
    assert len(np.unique(keys)) == len(keys)
    taken = set(grid.keys(grid.cells(xyz(cloud))).tolist())
    assert not taken & set(keys.tolist())
    # By brute force: every empty voxel of the box from whose centre the nearest point is in reach.
    for cell in np.argwhere(np.ones((6, 6, 6))):
        key = grid.keys(cell[None])[0]
        nearest = xyz(cloud)[np.linalg.norm(xyz(cloud) - (cell + 0.5), axis=1).argmin()].astype(np.float64)
        distance = np.linalg.norm(np.clip(nearest, cell + 0.002, cell + 0.998) - nearest)
        if key not in taken and abs(distance - 0.7) > 1e-6:
            assert (key in keys) == (distance < 0.7)
            if key in keys:
                assert places.distance_m[keys == key] == pytest.approx(distance, abs=1e-6)


@pytest.mark.parametrize("recipe", RECIPES)
def test_same_generator_same_cloud(make_cloud, make_boxes, make_detector, recipe):
    scene = scene_of(make_cloud, make_boxes, make_detector)
    first, second = (Attach(eps_m=0.3, points=9, recipe=recipe)(*scene, rng(5)) for _ in range(2))
    assert first.cloud.tobytes() == second.cloud.tobytes()


@pytest.mark.parametrize("recipe", [name for name in RECIPES if name != "random"])
def test_frames_with_nothing_to_attack_are_left_alone_and_said(hand_worked, make_cloud, make_boxes, recipe):
    cloud, boxes, detector = hand_worked
    attack = Attach(eps_m=0.3, points=5, recipe=recipe)
    for given, truth, said in ((cloud, make_boxes(), "no object"), (make_cloud([]), boxes, "no points")):
        result = attack(given, truth, detector, rng())
        assert result.cloud.tobytes() == given.tobytes()
        assert len(result.labels) == 0
        assert said in result.note


@pytest.mark.parametrize("recipe", ["best", "robust", "paper"])
def test_no_gradient_is_said(hand_worked, recipe):
    cloud, boxes, detector = hand_worked
    detector.weights = torch.zeros(10, 10, 10)
    result = Attach(eps_m=0.6, points=5, recipe=recipe)(cloud, boxes, detector, rng())
    assert result.cloud.tobytes() == cloud.tobytes()
    assert "no gradient" in result.note


def test_detector_without_occupancies_is_searched_and_it_is_said(make_cloud, make_boxes, make_detector):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)

    class Plain:
        classes, range_m = detector.classes, detector.range_m
        detect, loss = detector.detect, detector.loss

    result = Attach(eps_m=0.5, points=20)(cloud, boxes, Plain(), rng())
    assert "occupancy_loss" in result.note
    assert len(result.labels) == 20


def test_points_that_are_not_finite_stay_and_start_nothing(make_cloud, make_boxes, make_detector):
    cloud, boxes, detector = scene_of(make_cloud, make_boxes, make_detector)
    cloud["x"][:50] = np.nan
    result = Attach(eps_m=0.3, points=9)(cloud, boxes, detector, rng())
    assert result.cloud[:300].tobytes() == cloud.tobytes()
    assert np.isfinite(xyz(result.cloud[300:])).all()


def test_constraints_without_a_place_are_said(hand_worked):
    cloud, boxes, detector = hand_worked
    boxes.geometry[:, 2] += 0.45  # only the upper half of the voxels is inside, and no point in reach
    result = Attach(eps_m=0.01, points=5, near_objects_m=0.0)(cloud, boxes, detector, rng())
    assert len(result.labels) in (0, 5)
    assert bool(result.note)


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"eps_m": 0.0}, "eps_m is 0"),
        ({"eps_m": -0.1}, "eps_m is -0.1"),
        ({"eps_m": float("nan")}, "eps_m is nan"),
        ({"eps_m": 5.01}, "eps_m is 5.01"),
        ({"points": 0}, "points is 0"),
        ({"points": 2.5}, "points is 2.5"),
        ({"points": 100_001}, "points is 100001; it takes a number, 1 to 100000"),
        ({"points": float("nan")}, "points is nan"),
        ({"rounds": 0}, "rounds is 0"),
        ({"weight": -1.0}, "weight is -1"),
        ({"decay_m": 0.0}, "decay_m is 0"),
        ({"recipe": "worst"}, "known: best, hide, robust, stealthy, transfer, paper"),
        ({"ghost": "car:1"}, "CLASS:X:Y"),
        ({"ghost": "car:1:2", "objects": ("a",)}, "two attacks"),
        ({"near_objects_m": float("nan")}, "near_objects_m"),
    ],
)
def test_bad_parameters(bad, said):
    with pytest.raises(AdvpipeError, match=said):
        Attach(**{"eps_m": 0.3, **bad})
