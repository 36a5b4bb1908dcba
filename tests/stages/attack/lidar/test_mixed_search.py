"""Attacks on detectors without `occupancy_loss`, with a surrogate that proposes changes."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from framing_detector import ATTACKS, Framing, framed_car, rng, strict_matches
from linear_detector import BOX, LinearVoxelDetector

from advpipe.pipeline.adversary.surrogate import SurrogateDetector
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.quantities import CLOUD_QUANTITIES
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.messages.cloud import xyzi
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb

SMALL = {
    "perturb": lambda **options: Perturb(eps_cm=20, **options),
    "detach": lambda **options: Detach(ratio=0.05, **options),
    "attach": lambda **options: Attach(eps_m=0.8, points=20, **options),
}


class Foreign:
    """A linear detector on voxels that shows its detections alone, and counts its looks."""

    classes, range_m = ("car",), Range(0.0, 0.0, 0.0, 10.0, 10.0, 10.0)
    looks = 0

    def __init__(self, weights):
        self.inner = LinearVoxelDetector(weights, [BOX])

    def detect(self, cloud):
        self.looks += 1
        return self.inner.detect(cloud)

    def loss(self, points, boxes, labels):
        return torch.tensor(1.0)


def surrogate(seed=3, noise=0.0):
    """What a linear detector of these weights is, but for noise."""
    draw = np.random.default_rng(seed)
    weights = draw.normal(0, 0.06, (10, 10, 10))
    return weights, LinearVoxelDetector(weights + noise * draw.normal(0, 0.06, weights.shape), [BOX])


@pytest.fixture
def scene(make_cloud, make_boxes):
    cloud = make_cloud(np.random.default_rng(5).uniform(0, 10, (800, 3)))
    cloud["intensity"] = 0.5
    return cloud, make_boxes(BOX)


def score(detector, cloud):
    """Of the object, without the threshold of its detections."""
    boxes = torch.as_tensor(detector.anchors, dtype=torch.float32)
    return float(detector._scores(torch.from_numpy(xyzi(cloud)), boxes, torch.zeros(0, 4))[0].detach())


@pytest.mark.parametrize("name", SMALL)
def test_a_surrogate_that_is_nearly_right_beats_random_best_and_the_search_alone(scene, name):
    weights, guess = surrogate(noise=0.5)
    weights += 0.03  # so that the object is found
    victim = Foreign(weights)
    left = {}
    for label, recipe, detector in (
        ("with", "best", SurrogateDetector(victim, guess)),
        ("alone", "best", victim),
        ("random", "random-best", victim),
    ):
        attack, left[label] = SMALL[name](recipe=recipe), 0.0
        for seed in range(3):
            victim.looks = 0
            result = attack(*scene, detector, rng(seed))
            assert victim.looks <= attack.query_budget + 4
            assert ("shipped detector" in result.note) == (label == "with")
            change = CloudChange(scene[0], result.cloud, result.labels)
            assert not list(excesses(change, attack.bounds, CLOUD_QUANTITIES))
            left[label] += score(victim.inner, result.cloud)
    assert left["with"] < min(left["alone"], left["random"])


@pytest.mark.parametrize("name", ATTACKS)
def test_a_surrogate_of_no_use_does_little_harm(make_cloud, make_boxes, name):
    """Its weights are noise, and it knows nothing of the detector that frames points."""
    scene, detector = framed_car(make_cloud, make_boxes), Framing()
    seen = SurrogateDetector(detector, surrogate()[1])
    found = {"best": 0, "random-best": 0}
    for recipe in found:
        for seed in range(3):
            found[recipe] += strict_matches(
                detector, ATTACKS[name](recipe=recipe)(*scene, seen, rng(seed)).cloud, scene[1]
            )
    assert found["best"] <= found["random-best"]


@pytest.mark.parametrize("name", SMALL)
def test_same_generator_same_cloud(scene, name):
    weights, guess = surrogate(noise=0.5)
    first, second = (
        SMALL[name]()(*scene, SurrogateDetector(Foreign(weights + 0.03), guess), rng(3)) for _ in range(2)
    )
    assert first.cloud.tobytes() == second.cloud.tobytes()
    assert len(first.labels)


@pytest.mark.parametrize("name", SMALL)
def test_black_box_recipes_do_not_see_the_surrogate(scene, name):
    weights, guess = surrogate()
    victim = Foreign(weights + 0.03)
    attack = SMALL[name](recipe="score-based", queries=6)
    with_it, without = (attack(*scene, each, rng()) for each in (SurrogateDetector(victim, guess), victim))
    assert with_it.cloud.tobytes() == without.cloud.tobytes()
