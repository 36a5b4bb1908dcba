"""Recipes `robust` and `transfer`: what they do holds under defences and on another detector."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from linear_detector import LinearVoxelDetector

from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.protocol import Range, VoxelGrid
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb

CAR = [5.0, 0.0, 5.0, 10.0, 10.0, 10.0, 0.0]
DEFENCES = ["flip", "shift", "jitter", "quantise", "sample"]


class Centred(LinearVoxelDetector):
    """The same with y in [-5, 5), so that a mirror image is in its range."""

    range_m = Range(0.0, -5.0, 0.0, 10.0, 5.0, 10.0)
    voxel_grid = VoxelGrid((0.0, -5.0, 0.0), (1.0, 1.0, 1.0), (10, 10, 10))

    def _scores(self, points, boxes, probes):
        aside = torch.tensor([0.0, 5.0, 0.0, 0.0])
        centred = boxes + torch.tensor([0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        return super()._scores(points + aside, centred, probes + aside)


@pytest.fixture
def scene(make_cloud, make_boxes):
    """A car of 20 points to the left and 20 to the right, of which the detector reads those to the left: in
    a mirror image, the others. It finds the car with 9 of them."""
    side = np.array([[x + 0.5, y + 0.5, 5.5] for x in range(5) for y in range(4)])
    weights = np.zeros((10, 10, 10))
    weights[:5, 5:9, 5] = 0.06
    weights[:5, 5:9, 8] = -0.3  # points above them hide the car
    return make_cloud(np.concatenate([side, side * (1, -1, 1)])), make_boxes(CAR), Centred(weights, [CAR])


def found_under(result, detector):
    """The defences, or none, under which the car is found in any of three draws."""
    found = []
    for name, defence in {"none": None, **parse_defences(DEFENCES)}.items():
        rng = np.random.default_rng(8)
        clouds = [defence(result.cloud, rng).cloud if defence else result.cloud for _ in range(3)]
        if any(len(detector.detect(cloud)) for cloud in clouds):
            found.append(name.partition(":")[0])
    return found


EACH_ATTACK = pytest.mark.parametrize(
    "attack_of",
    [
        lambda recipe, **more: Detach(ratio=0.7, recipe=recipe, **more),
        lambda recipe, **more: Perturb(eps_cm=99, recipe=recipe, **more),
        lambda recipe, **more: Attach(eps_m=4.0, points=12, recipe=recipe, **more),
    ],
    ids=["detach", "perturb", "attach"],
)


@EACH_ATTACK
def test_robust_holds_where_best_does_not(scene, attack_of):
    assert "flip" in found_under(attack_of("best")(*scene, np.random.default_rng(1)), scene[2])
    assert found_under(attack_of("robust")(*scene, np.random.default_rng(1)), scene[2]) == []


@EACH_ATTACK
def test_transfer_holds_on_a_detector_that_it_does_not_know(scene, attack_of):
    """The other detector reads the points to the right. Goal "hide": the box that these detectors find stays
    where it is, so that it would be displaced in every view that is turned."""
    cloud, _, attacked = scene
    other = Centred(attacked.weights.numpy()[:, ::-1].copy(), [CAR])
    found = {}
    for recipe in ("best", "transfer"):
        left = attack_of(recipe, goal="hide")(*scene, np.random.default_rng(1)).cloud
        found[recipe] = len(attacked.detect(left)), len(other.detect(left))
    assert len(other.detect(cloud)) == 1
    assert found == {"best": (0, 1), "transfer": (0, 0)}
