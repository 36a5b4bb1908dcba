"""Attacks on ensembles: an object is lost where no member finds it, and bags name all members."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from linear_detector import LinearVoxelDetector

from advpipe.pipeline.adversary.black_box import BlackBoxDetector
from advpipe.pipeline.adversary.constraints import Constraints
from advpipe.pipeline.adversary.goal import goal_of, joint_success, known_boxes
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.ensemble import ensemble_of
from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.pipeline.detector.registry import detector_sha256
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.detection.comparison import Comparison

CAR = [5.0, 5.0, 5.0, 10.0, 10.0, 10.0, 0.0]


class Coarse(LinearVoxelDetector):
    """Reads cubes of 2 m: weights (5, 5, 5)."""

    voxel_grid = VoxelGrid((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), (5, 5, 5))

    def _scores(self, points, boxes, probes):
        half, boxes = torch.tensor([0.5, 0.5, 0.5, 1.0]), boxes * torch.tensor([0.5] * 6 + [1.0])
        return super()._scores(points * half, boxes, probes * half)


@pytest.fixture
def scene(make_cloud, make_boxes):
    """A car of 20 points to the left and 20 to the right; each member reads one side, the other in cubes of
    2 m, and finds the car with half of its points. Points above the side that it reads hide the car."""
    side = np.array([[x + 0.5, y + 0.5, 5.5] for x in range(5) for y in range(4)])
    fine, coarse = np.zeros((10, 10, 10)), np.zeros((10, 10, 10))
    fine[:5, :4, 5], fine[:5, :4, 8] = 0.06, -0.3
    coarse[:3, 3:5, 2], coarse[:3, 3:5, 4] = 0.15, -0.5
    cloud = make_cloud(np.concatenate([side, side + (0, 6, 0)]))
    return cloud, make_boxes(CAR), [LinearVoxelDetector(fine, [CAR]), Coarse(coarse, [CAR])]


def finders(members, cloud):
    return [number for number, each in enumerate(members) if len(each.detect(cloud))]


ATTACKS = {
    "detach": lambda **more: Detach(ratio=0.7, **more),
    "perturb": lambda **more: Perturb(eps_cm=110, **more),
    "attach": lambda **more: Attach(eps_m=4.0, points=12, **more),
}


@pytest.mark.parametrize("name", ATTACKS)
def test_no_member_finds_what_the_ensemble_lost(scene, name):
    cloud, boxes, members = scene
    assert finders(members, cloud) == [0, 1]
    for number, member in enumerate(members):
        alone = ATTACKS[name]()(cloud, boxes, member, np.random.default_rng(1)).cloud
        assert finders(members, alone) == [1 - number]
    together = ATTACKS[name]()(cloud, boxes, ensemble_of(members), np.random.default_rng(1))
    assert finders(members, together.cloud) == []
    assert together.loss_after > together.loss_before


@pytest.mark.parametrize("recipe", ["robust", "transfer", "paper", "random-best", "score-based"])
@pytest.mark.parametrize("name", ATTACKS)
def test_every_recipe_takes_an_ensemble(scene, name, recipe):
    cloud, boxes, members = scene
    result = ATTACKS[name](recipe=recipe)(cloud, boxes, ensemble_of(members), np.random.default_rng(1))
    assert len(result.labels)
    assert "gradient" not in result.note


def test_an_object_counts_until_no_member_finds_it():
    each = np.array([[-0.9, -0.9, 0.2, 0.0], [-0.5, 0.3, 0.1, -0.4]])
    assert joint_success(each) == pytest.approx([-0.7, -0.45, 0.15, -0.2])


def test_success_is_that_against_all_members(scene):
    cloud, boxes, members = scene
    ensemble = ensemble_of(members)
    goal = goal_of(Constraints(), ensemble, cloud, boxes)
    alone = [goal.success(each.detect(cloud)) for each in members]
    assert goal.success(ensemble.detect(cloud)) == pytest.approx(np.mean(alone, axis=0))
    left = cloud[cloud["y"] < 5]  # the coarse member finds nothing there
    assert goal.success(ensemble.detect(left)) == pytest.approx(alone[0] / 2)
    assert goal.success(ensemble.detect(cloud[:0])) == pytest.approx([0.0])


def test_decisions_keep_their_member(scene):
    cloud, _, members = scene
    told = BlackBoxDetector(ensemble_of(members), scores=False).detect(cloud)
    assert sorted(told.member.tolist()) == [0, 1]
    assert told.scores.tolist() == [1.0, 1.0]


def test_objects_that_two_members_find_are_known_once(scene):
    cloud, boxes, members = scene
    known = known_boxes(Constraints(truth="detections"), ensemble_of(members), cloud, boxes)
    assert len(known) == 1


ENSEMBLE = "linear_detector:Shipped,linear_detector:Batched"


def test_a_bag_names_all_members(clean_bag, tmp_path):
    spec = attack_spec({"type": "detach", "parameters": {"ratio": 0.1, "rounds": 2}, "detector": ENSEMBLE})
    attack(clean_bag, tmp_path / "out", AttackRequest((spec,), seed=1), workers=1)
    provenance = BagReader(tmp_path / "out").provenance
    digest = detector_sha256("linear_detector:Shipped")
    assert provenance["detector"] == ENSEMBLE
    assert provenance["detector_sha256"] == f"{digest},{digest}"
    (recorded,) = json.loads(provenance["attacks"])
    assert (recorded["detector"], recorded["detector_sha256"]) == (ENSEMBLE, f"{digest},{digest}")
    for name, expected in (("Shipped", True), ("Batched", True), ("Interrupted", False)):
        made = Comparison(None, provenance, (), detector=f"linear_detector:{name}", detector_sha256=digest)
        assert made.is_white_box is expected


@pytest.mark.parametrize(
    ("attacked", "evaluated", "expected"),
    [("a,b", "b", True), ("a,b", "c", False), ("a", "a", True), ("", "a", None), ("a,b", "", None)],
)
def test_a_member_was_attacked(attacked, evaluated, expected):
    record = Provenance({"detector": "x,y", "detector_sha256": attacked} if attacked else {})
    assert Comparison(None, record, (), detector="z", detector_sha256=evaluated).is_white_box is expected
