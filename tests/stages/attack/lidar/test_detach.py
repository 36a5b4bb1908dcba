from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from cloud_moves import rng
from linear_detector import LinearVoxelDetector

from advpipe.pipeline.adversary.constraints import BLACK_BOX
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import OccupancyLoss
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import xyz
from advpipe.stages.attack.lidar.detach import RECIPES as EVERY_RECIPE
from advpipe.stages.attack.lidar.detach import Detach

RECIPES = tuple(name for name in EVERY_RECIPE if name not in ("stealthy", *BLACK_BOX))
"""Those that need no rings; the others are in `test_stealthy`."""

CHANCE = ("random", "random-near", "random-best")
A, B, C = {5}, {2, 3, 4}, {6, 7}  # points of the hand-worked cloud, by voxel


@pytest.mark.parametrize(
    ("ratio", "rounds", "removed"),
    [
        (0.1, 1, A),  # one point: C gains more per point, but does not fit
        (0.2, 1, C),
        (0.3, 1, A | C),
        (0.3, 3, A | C),
    ],
)
def test_best_empties_the_voxels_that_gain_most(hand_worked, ratio, rounds, removed):
    result = Detach(ratio=ratio, rounds=rounds)(*hand_worked, rng())
    assert set(result.labels.point.tolist()) == removed


def test_losses_are_those_of_the_clean_and_the_adversarial_cloud(hand_worked):
    result = Detach(ratio=0.3, rounds=1)(*hand_worked, rng())
    assert result.loss_before == pytest.approx(-(4 * 1.005 + 6 * 1.015 + 9 * 1.025))
    assert result.loss_after == pytest.approx(-6 * 1.015)


def test_paper_removes_the_largest_gradients(hand_worked):
    # |dL/dx| of a point is weight / (100 * points in its voxel): C .045, A .04, B .02.
    result = Detach(ratio=0.3, recipe="paper", rounds=1)(*hand_worked, rng())
    assert set(result.labels.point.tolist()) == A | C


def test_paper_ranks_again_after_each_round(hand_worked):
    # One point of C goes first; the other one then carries the whole gradient of its voxel, .09.
    result = Detach(ratio=0.2, recipe="paper", rounds=2)(*hand_worked, rng())
    assert set(result.labels.point.tolist()) == C


def random_scene(make_cloud, make_boxes, make_detector, points=2000):
    draw = np.random.default_rng(3)
    cloud = make_cloud(draw.uniform(0, 10, (points, 3)))
    box = [2.0, 2.0, 2.0, 4.0, 4.0, 4.0, 0.0]
    return cloud, make_boxes(box), make_detector(draw.uniform(0.1, 1, (10, 10, 10)), [box])


def test_each_recipe_is_stronger_than_a_random_one_with_the_same_count(make_cloud, make_boxes, make_detector):
    scene = random_scene(make_cloud, make_boxes, make_detector)
    after = {name: Detach(ratio=0.02, recipe=name)(*scene, rng()).loss_after for name in RECIPES}
    for name in ("best", "robust", "paper"):
        assert after[name] > max(after[chance] for chance in CHANCE) + 1


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize(
    ("ratio", "rounds", "count"),
    [(0.01, 10, 20), (0.0123, 10, 25), (0.00125, 10, 3), (0.0001, 10, 1), (0.5, 3, 1000)],
)
def test_exactly_the_budget_is_removed(make_cloud, make_boxes, make_detector, recipe, ratio, rounds, count):
    scene = random_scene(make_cloud, make_boxes, make_detector)
    result = Detach(ratio=ratio, recipe=recipe, rounds=rounds)(*scene, rng())
    assert len(result.cloud) == 2000 - count
    assert len(result.labels) == count
    assert np.array_equal(np.delete(scene[0], result.labels.point), result.cloud)
    assert (result.labels.action == "removed").all()
    assert np.isnan(result.labels.displacement_m).all()


@pytest.mark.parametrize("recipe", RECIPES)
def test_same_generator_same_cloud(make_cloud, make_boxes, make_detector, recipe):
    scene = random_scene(make_cloud, make_boxes, make_detector)
    first, second = (Detach(ratio=0.05, recipe=recipe)(*scene, rng(5)) for _ in range(2))
    assert first.cloud.tobytes() == second.cloud.tobytes()


def test_random_depends_on_the_generator(hand_worked):
    chosen = {tuple(Detach(ratio=0.3, recipe="random")(*hand_worked, rng(s)).labels.point) for s in range(8)}
    assert len(chosen) > 4


@pytest.mark.parametrize("recipe", [name for name in RECIPES if name != "random"])
def test_frame_without_objects_is_left_alone_and_said(hand_worked, make_boxes, recipe):
    cloud, _, detector = hand_worked
    far = make_boxes([100.0, 0.5, 0.5, 3.0, 1.0, 1.0, 0.0])  # outside the detector's range
    for boxes in (make_boxes(), far):
        result = Detach(ratio=0.3, recipe=recipe)(cloud, boxes, detector, rng())
        assert result.cloud.tobytes() == cloud.tobytes()
        assert len(result.labels) == 0
        assert "no object" in result.note


def test_object_of_a_class_that_the_detector_lacks_is_no_target(hand_worked):
    cloud, boxes, detector = hand_worked
    detector.classes = ("pedestrian",)
    assert "no object" in Detach(ratio=0.3)(cloud, boxes, detector, rng()).note


@pytest.mark.parametrize("recipe", ["best", "robust", "paper"])
def test_no_gradient_is_said(hand_worked, recipe):
    cloud, boxes, detector = hand_worked
    detector.weights = torch.zeros(10, 10, 10)
    result = Detach(ratio=0.3, recipe=recipe)(cloud, boxes, detector, rng())
    assert result.cloud.tobytes() == cloud.tobytes()
    assert "no gradient" in result.note


def test_gradient_used_up_fills_the_budget_at_random(hand_worked):
    cloud, boxes, detector = hand_worked
    result = Detach(ratio=0.8, recipe="paper", rounds=4)(
        cloud, boxes, detector, rng()
    )  # the car has six points
    assert set(result.labels.point.tolist()) >= A | B | C
    assert len(result.labels) == 8
    assert "at random" in result.note


class WithBackground(LinearVoxelDetector):
    """Its loss also counts what stands at the anchors that are no target, as a detector's does."""

    def occupancy_loss(self, points, boxes, labels, probes=None):
        anchors = torch.as_tensor(self.anchors, dtype=torch.float32)
        probes = torch.zeros(0, 4) if probes is None else probes
        scores, occupancy, voxel = self._scores(points, anchors, probes)
        is_target = (anchors[:, None] == boxes[None]).all(2).any(1)
        loss = torch.where(is_target, -scores, scores).sum()
        return OccupancyLoss(loss, occupancy, voxel)

    def loss(self, points, boxes, labels):
        return self.occupancy_loss(points, boxes, labels).loss


def two_cars(make_cloud, make_boxes):
    """Car 0 is lost with its five points, all in one voxel of weight 0.6; car 1 with seven of its ten, in
    voxels of weight 0.15 each: point for point it gains the loss more."""
    first, second = [0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 0.0], [5.0, 5.5, 5.5, 10.0, 1.0, 1.0, 0.0]
    weights = np.zeros((10, 10, 10))
    weights[0, 0, 0], weights[:, 5, 5] = 0.6, 0.15
    points = (
        [[0.5, 0.5, 0.5]] * 5 + [[x + 0.5, 5.5, 5.5] for x in range(10)] + [[9.5, 0.5, z] for z in range(5)]
    )
    return make_cloud(points), make_boxes(first, second), WithBackground(weights, [first, second])


def test_budget_goes_to_the_object_that_falls_to_the_fewest_points(make_cloud, make_boxes):
    cloud, boxes, detector = two_cars(make_cloud, make_boxes)
    result = Detach(ratio=0.25, rounds=5)(cloud, boxes, detector, rng())
    assert result.labels.point.tolist() == [0, 1, 2, 3, 4]
    (left,) = detector.detect(result.cloud).boxes
    assert left.tolist() == boxes.geometry[1].tolist()


def test_only_chosen_objects_are_attacked(make_cloud, make_boxes):
    cloud, boxes, detector = two_cars(make_cloud, make_boxes)
    for name, named in (("car1", boxes), ("1", replace(boxes, ids=("",) * len(boxes)))):
        result = Detach(ratio=0.35, rounds=5, objects=(name,))(cloud, named, detector, rng())
        assert len(result.labels) == 7
        assert set(result.labels.point.tolist()) <= set(range(5, 15))
        (left,) = detector.detect(result.cloud).boxes
        assert left.tolist() == boxes.geometry[0].tolist()
    assert "no object" in Detach(ratio=0.25, objects=("other",))(cloud, boxes, detector, rng()).note


@pytest.mark.parametrize("recipe", RECIPES)
def test_constraints_hold(make_cloud, make_boxes, make_detector, recipe):
    scene = random_scene(make_cloud, make_boxes, make_detector)
    result = Detach(ratio=0.01, recipe=recipe, near_objects_m=0.0, max_points=7)(*scene, rng())
    assert len(result.labels) == 7
    (inside,) = points_in_boxes(xyz(scene[0]), scene[1].geometry)
    assert set(result.labels.point.tolist()) <= set(inside.tolist())


def test_fewer_points_near_objects_than_asked_for_are_said(hand_worked):
    result = Detach(ratio=0.8, recipe="random", near_objects_m=0.0)(*hand_worked, rng())
    assert set(result.labels.point.tolist()) == A | B | C
    assert "only 6 points" in result.note


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize("points", [0, 1])
def test_cloud_with_no_point_to_spare(make_cloud, hand_worked, recipe, points):
    _, boxes, detector = hand_worked
    result = Detach(ratio=0.9, recipe=recipe)(make_cloud([[0.5, 0.5, 0.5]] * points), boxes, detector, rng())
    assert len(result.cloud) == points
    assert "no points" in result.note


class Plain:
    """What any detector shows: no occupancies."""

    def __init__(self, detector):
        self.classes, self.range_m = detector.classes, detector.range_m
        self.detect, self.loss = detector.detect, detector.loss


def test_detector_without_occupancies_is_searched_and_it_is_said(make_cloud, make_boxes, make_detector):
    cloud, boxes, detector = random_scene(make_cloud, make_boxes, make_detector)
    result = Detach(ratio=0.02)(cloud, boxes, Plain(detector), rng())
    chance = Detach(ratio=0.02, recipe="random-near")(cloud, boxes, Plain(detector), rng())
    assert "occupancy_loss" in result.note
    assert len(result.labels) == 40
    assert result.loss_after > chance.loss_after


@pytest.mark.parametrize("recipe", RECIPES)
def test_points_that_are_not_finite_do_not_count_and_stay(hand_worked, recipe):
    cloud, boxes, detector = hand_worked
    silent = np.zeros(90, cloud.dtype)
    silent["x"] = np.nan  # as drivers store a ray without an echo
    result = Detach(ratio=0.3, recipe=recipe, rounds=1)(
        np.concatenate([silent, cloud]), boxes, detector, rng()
    )
    assert len(result.labels) == 3
    assert result.labels.point.min() >= 90
    assert np.isfinite([result.loss_before, result.loss_after]).all()
    if recipe not in CHANCE:
        assert set((result.labels.point - 90).tolist()) == A | C


@pytest.mark.parametrize("ratio", [float("nan"), 0.0, -0.01, 1.0, 2.0, float("inf")])
def test_bad_ratio(ratio):
    with pytest.raises(AdvpipeError, match="ratio is"):
        Detach(ratio=ratio)


@pytest.mark.parametrize("rounds", [0, -1, 2.5, float("nan"), float("inf")])
def test_bad_rounds(rounds):
    with pytest.raises(AdvpipeError, match="rounds is"):
        Detach(ratio=0.01, rounds=rounds)


def test_unknown_recipe():
    with pytest.raises(AdvpipeError, match="best, hide, robust, stealthy, transfer, paper, score-based"):
        Detach(ratio=0.01, recipe="worst")
