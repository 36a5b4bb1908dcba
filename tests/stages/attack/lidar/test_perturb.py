from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from cloud_moves import moved_m, rng

from advpipe.pipeline.adversary.constraints import BLACK_BOX, Rules
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.per_object_best import PerObjectBest
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.messages.cloud import xyz, xyzi
from advpipe.stages.attack.lidar.perturb import RECIPES, Perturb
from advpipe.stages.attack.lidar.pgd import project

RECIPE_NAMES = tuple(RECIPES)


def plain(voxel_detector):
    """The same detector, but nobody knows that it has voxels."""

    class Plain:
        classes, range_m = voxel_detector.classes, voxel_detector.range_m
        detect, loss = voxel_detector.detect, voxel_detector.loss

    return Plain()


def test_best_empties_all_voxels_in_reach(hand_worked):
    # Each point can leave the car through a face at most 50 cm away; B and C only as groups.
    result = Perturb(eps_cm=51)(*hand_worked, rng())
    assert result.loss_before == pytest.approx(-(4 * 1.005 + 6 * 1.015 + 9 * 1.025))
    assert result.loss_after == 0
    assert set(result.labels.point.tolist()) == {2, 3, 4, 5, 6, 7}
    assert (result.labels.action == "moved").all()


def test_too_short_a_reach_changes_nothing(hand_worked):
    # All points of the car are 19 cm or more away from the nearest face that they could cross.
    result = Perturb(eps_cm=15)(*hand_worked, rng())
    assert result.cloud.tobytes() == hand_worked[0].tobytes()
    assert result.loss_after == result.loss_before
    assert result.note == "nothing moved: no point that may move does harm in its reach"


def test_best_raises_the_loss_more_than_the_others(scene):
    after = {name: Perturb(eps_cm=30, recipe=name)(*scene, rng()).loss_after for name in RECIPE_NAMES}
    # The detector of this test is one object, so that best must hide it wholly to be kept: compare unkept.
    attack = Perturb(eps_cm=30)
    attack.settings = type(attack.settings)(keep_best=False)
    crossed = attack(*scene, rng()).loss_after
    assert crossed > max(after["random"], after["random-near"], after["paper"]) + 5


@pytest.mark.parametrize("recipe", RECIPE_NAMES)
@pytest.mark.parametrize("eps_cm", [0.003, 0.5, 1, 10, 77, 500])
def test_no_point_moves_farther_than_eps(scene, recipe, eps_cm):
    cloud = scene[0].copy()
    for offset in (0, 0.1, 63.7):  # coordinates of many magnitudes
        cloud["x"][400:] += offset
        for seed in range(2):
            result = Perturb(eps_cm=eps_cm, recipe=recipe, steps=3)(cloud, *scene[1:], rng(seed))
            assert len(result.cloud) == len(cloud)
            assert (moved_m(cloud, result.cloud) <= eps_cm / 100).all()
            changed = np.flatnonzero(moved_m(cloud, result.cloud))
            assert changed.tolist() == result.labels.point.tolist()
            np.testing.assert_array_equal(moved_m(cloud, result.cloud)[changed], result.labels.displacement_m)
            for name in ("intensity", "ring", "time"):
                assert result.cloud[name].tobytes() == cloud[name].tobytes()


def test_random_moves_all_points_by_eps(scene):
    far_m = moved_m(scene[0], Perturb(eps_cm=7, recipe="random")(*scene, rng()).cloud)
    assert far_m == pytest.approx(0.07, rel=1e-4)


@pytest.mark.parametrize("recipe", ["best", "robust", "random-near", "random-best"])
def test_only_points_near_objects_move(scene, recipe):
    attack = Perturb(eps_cm=40, recipe=recipe, steps=3)
    attack.settings = type(attack.settings)(keep_best=False)
    near = points_in_boxes(xyz(scene[0]), scene[1].geometry, attack.settings.margin_m)[0]
    assert np.isin(attack(*scene, rng()).labels.point, near).all()


class Quadratic:
    """Its loss is half the squared distance of the points (those with x > 0) from the origin."""

    classes, range_m = ("car",), None

    def __init__(self, like):
        self.range_m, self.detect = like.range_m, like.detect

    def loss(self, points, boxes, labels):
        return (points[:, :3] ** 2).sum(1)[points[:, 0] > 0].sum() / 2


def test_paper_climbs_along_the_gradient_to_the_sphere(scene, make_cloud):
    cloud = make_cloud([[3.0, 0.0, 4.0]] * 200 + [[4.0, 5.0, 5.0]] * 5)
    attack = Perturb(eps_cm=10, recipe="paper", weight=0.0)
    after = attack(cloud, scene[1], Quadratic(scene[2]), rng()).cloud
    way = (xyz(after).astype(np.float64) - xyz(cloud))[:200]
    along_m = way @ [0.6, 0, 0.8]  # 40 steps of eps / 30: farther than from the far side of the ball
    assert along_m.min() > 0.03
    assert along_m.mean() > 0.08
    assert np.median(moved_m(cloud, after)[:200]) == pytest.approx(0.1, rel=1e-4)


def test_paper_walks_back_where_only_the_displacement_counts(scene, make_cloud):
    cloud = make_cloud([[-3.0, 0.0, 4.0]] + [[4.0, 5.0, 5.0]] * 5)
    free = Perturb(eps_cm=10, recipe="paper", weight=0.0)(cloud, scene[1], Quadratic(scene[2]), rng())
    weighed = Perturb(eps_cm=10, recipe="paper", weight=0.01)(cloud, scene[1], Quadratic(scene[2]), rng())
    assert moved_m(cloud, free.cloud)[0] > 0.02  # no gradient: it stays where the start put it
    assert moved_m(cloud, weighed.cloud)[0] < 0.1 / 30 + 1e-6


def test_projection_leaves_what_is_inside_and_shortens_the_rest():
    offset = torch.tensor([[0.001, 0.0, 0.0], [3.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    expected = torch.tensor([[0.001, 0.0, 0.0], [0.06, 0.0, 0.08], [0.0, 0.0, 0.0]])
    torch.testing.assert_close(project(offset, 0.1), expected)


def test_random_start_fills_the_ball(scene, make_cloud):
    # Nothing pulls these points, so that they stay where the start put them.
    cloud = make_cloud([[-1.0, 1.0, 1.0]] * 4000 + [[4.0, 5.0, 5.0]] * 5)
    attack = Perturb(eps_cm=10, recipe="paper", weight=0.0, steps=1)
    far_m = moved_m(cloud, attack(cloud, scene[1], Quadratic(scene[2]), rng()).cloud)[:4000]
    # A cube of half-width eps: a share pi / 6 lies in the ball, the rest is projected onto the sphere.
    assert (far_m < 0.0999).mean() == pytest.approx(math.pi / 6, abs=0.02)


def test_detector_without_occupancies_is_searched_and_it_is_said(scene):
    attack = Perturb(eps_cm=40, steps=3)
    result = attack(scene[0], scene[1], plain(scene[2]), rng())
    assert "occupancy_loss" in result.note
    near = points_in_boxes(xyz(scene[0]), scene[1].geometry, attack.settings.margin_m)[0]
    assert np.isin(result.labels.point, near).all()


@pytest.mark.parametrize("recipe", RECIPE_NAMES)
def test_same_generator_same_cloud(scene, recipe):
    first, second = (Perturb(eps_cm=20, recipe=recipe, steps=3)(*scene, rng(5)) for _ in range(2))
    assert first.cloud.tobytes() == second.cloud.tobytes()


@pytest.mark.parametrize("recipe", RECIPE_NAMES)
def test_points_that_are_not_finite_stay(hand_worked, recipe):
    cloud, boxes, detector = hand_worked
    silent = np.zeros(90, cloud.dtype)
    silent["x"] = np.nan
    mixed = np.concatenate([silent, cloud])
    result = Perturb(eps_cm=51, recipe=recipe, steps=4)(mixed, boxes, detector, rng())
    assert result.cloud[:90].tobytes() == silent.tobytes()
    assert np.isfinite(xyzi(result.cloud[90:])).all()
    assert (result.labels.point >= 90).all()


@pytest.mark.parametrize("recipe", [name for name in RECIPE_NAMES if name not in ("random", *BLACK_BOX)])
def test_frame_without_objects_is_left_alone_and_said(scene, make_boxes, recipe):
    result = Perturb(eps_cm=10, recipe=recipe)(scene[0], make_boxes(), scene[2], rng())
    assert result.cloud.tobytes() == scene[0].tobytes()
    assert len(result.labels) == 0
    assert "no object" in result.note


@pytest.mark.parametrize("recipe", ["best", "robust", "paper"])
def test_no_gradient_is_said(scene, recipe):
    scene[2].weights = torch.zeros(10, 10, 10)
    result = Perturb(eps_cm=10, recipe=recipe)(*scene, rng())
    assert result.cloud.tobytes() == scene[0].tobytes()
    assert "no gradient" in result.note


@pytest.mark.parametrize("recipe", RECIPE_NAMES)
def test_cloud_without_points(make_cloud, scene, recipe):
    result = Perturb(eps_cm=10, recipe=recipe)(make_cloud([]), *scene[1:], rng())
    assert "no points" in result.note


@pytest.mark.parametrize("recipe", RECIPE_NAMES)
def test_limit_on_points(scene, recipe):
    attack = Perturb(eps_cm=40, recipe=recipe, steps=3, max_points=7)
    attack.settings = type(attack.settings)(keep_best=False)
    assert 0 <= len(attack(*scene, rng()).labels) <= 7


@pytest.mark.parametrize("recipe", RECIPE_NAMES)
def test_along_the_ray(scene, recipe):
    attack = Perturb(eps_cm=40, recipe=recipe, steps=3, along_ray=True)
    attack.settings = type(attack.settings)(keep_best=False)
    result = attack(*scene, rng())
    start = xyz(scene[0]).astype(np.float64)
    away = np.cross(xyz(result.cloud) - start, start)
    assert len(result.labels) > 10 or recipe in ("random-best", "best", "robust", "transfer")
    assert np.abs(away).max() < 1e-4


def test_occlusion_order_is_kept(scene):
    attack = Perturb(eps_cm=100, steps=3, keep_occlusion_order=True)
    attack.settings = type(attack.settings)(keep_best=False)
    result = attack(*scene, rng())
    rules = Rules(attack.constraints, xyz(scene[0]), scene[1])
    moved = result.labels.point
    assert len(moved) > 10
    newly = rules.hidden(xyz(result.cloud)[moved]) & ~rules.hidden(xyz(scene[0])[moved])
    assert not newly.any()


def test_intensities_are_attacked_on_demand_only(scene):
    attack = Perturb(eps_cm=40, steps=3, intensity=True)
    attack.settings = type(attack.settings)(keep_best=False)
    result = attack(*scene, rng())
    untouched = np.delete(np.arange(800), result.labels.point)
    assert (result.cloud["intensity"][untouched] == scene[0]["intensity"][untouched]).all()
    assert result.cloud["intensity"].min() >= scene[0]["intensity"].min()
    assert result.cloud["intensity"].max() <= scene[0]["intensity"].max()


@pytest.mark.parametrize("eps_cm", [float("nan"), 0.0, -1.0, 500.1, float("inf")])
def test_bad_reach(eps_cm):
    with pytest.raises(AdvpipeError, match="eps_cm is") as caught:
        Perturb(eps_cm=eps_cm)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"recipe": "worst"}, "known: best, hide, robust, stealthy, transfer, paper"),
        ({"steps": -1}, "steps is -1"),
        ({"steps": 2.5}, "steps is 2.5"),
        ({"weight": -1.0}, "weight is -1.0"),
        ({"weight": float("nan")}, "weight is nan"),
        ({"max_points": 0}, "max_points is 0"),
    ],
)
def test_bad_parameters(wrong, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        Perturb(eps_cm=1, **wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("steps", [4, 12, 24, 30])
def test_best_judges_as_many_candidates_as_it_declares(scene, monkeypatch, steps):
    """`random-best` is given this number, and it judges nothing but its draws."""
    judged, combined = [], []
    update, judge_combination = PerObjectBest.update, PerObjectBest._judge_combination

    def counted(self, candidate, found=None):
        judged.append((candidate != xyzi(scene[0])).any())
        return update(self, candidate, found)

    def counted_combination(self):
        combined.append(len(judged))
        judge_combination(self)

    monkeypatch.setattr(PerObjectBest, "update", counted)
    monkeypatch.setattr(PerObjectBest, "_judge_combination", counted_combination)
    monkeypatch.setattr(AttackGoal, "is_done", lambda self, success: np.zeros(len(success), bool))
    attack = Perturb(eps_cm=10, steps=steps)
    attack(*scene, rng())
    assert len(judged) + len(combined) == steps + 1
    assert judged[0] == 0  # the clean cloud, from which the first gradient is
    assert combined == [math.ceil(0.75 * steps)]
    assert attack.query_budget == steps
