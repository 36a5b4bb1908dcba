"""Black-box recipes: what they see of a detector, and that they attack with it alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from framing_detector import ATTACKS, Framing, Sloped, framed_car, rng, strict_matches

from advpipe.pipeline.adversary.black_box import BlackBoxDetector, as_seen_by, told_by
from advpipe.pipeline.adversary.constraints import BLACK_BOX
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, VoxelDetector
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.quantities import CLOUD_QUANTITIES
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.lidar.detach import Detach


@pytest.fixture
def scene(make_cloud, make_boxes):
    return framed_car(make_cloud, make_boxes)


class Spying(Framing):
    """Counts how often its loss is asked for."""

    losses = 0

    def loss(self, points, boxes, labels):
        self.losses += 1
        return super().loss(points, boxes, labels)


@pytest.mark.parametrize("name", ATTACKS)
@pytest.mark.parametrize("recipe", BLACK_BOX)
def test_it_hides_the_object_by_its_queries_alone(scene, name, recipe):
    cloud, boxes = scene
    elsewhere = replace(boxes, geometry=boxes.geometry + [50, 0, 0, 0, 0, 0, 0])
    detector, found = Spying(), 0
    for seed in range(3):
        attack = ATTACKS[name](recipe=recipe, queries=30)
        detector.looks = detector.losses = 0
        result = attack(cloud, elsewhere, detector, rng(seed))  # true boxes that would mislead it
        # The object before and after, and in the adversarial cloud, are no candidates.
        assert detector.looks <= attack.query_budget + 5
        assert detector.losses == 2  # those that are reported
        assert "occupancy_loss" not in result.note
        change = CloudChange(cloud, result.cloud, result.labels)
        assert not list(excesses(change, attack.bounds, CLOUD_QUANTITIES))
        found += strict_matches(detector, result.cloud, boxes)
    assert found <= 1


def test_a_gradient_is_not_followed(scene):
    """With a loss that has a gradient and with one that has none, the attack is the same."""
    for name in ATTACKS:
        first, second = (
            ATTACKS[name](recipe="score-based", queries=12)(*scene, detector, rng())
            for detector in (Framing(), Sloped())
        )
        assert first.cloud.tobytes() == second.cloud.tobytes()


def test_decisions_have_no_scores_and_no_order():
    boxes = np.array([[9.0, 0, 0, 4, 2, 2, 0], [1.0, 0, 0, 4, 2, 2, 0], [5.0, 0, 0, 4, 2, 2, 0]])
    found = Detections(boxes, np.array([0.9, 0.5, 0.2]), np.array([0, 1, 0]))
    seen = BlackBoxDetector(Framing(), scores=False)
    told = told_by(seen, found)
    assert told.boxes[:, 0].tolist() == [1, 9]
    assert told.labels.tolist() == [1, 0]
    assert told.scores.tolist() == [1, 1]
    assert told_by(BlackBoxDetector(Framing()), found) is found
    assert told_by(Framing(), found) is found
    assert isinstance(seen, ObjectDetector)
    assert not isinstance(seen, VoxelDetector)


def test_other_recipes_see_the_detector_itself():
    detector = Framing()
    assert as_seen_by("best", detector) is detector
    assert as_seen_by("score-based", detector) == BlackBoxDetector(detector)
    assert (
        not as_seen_by("score-based", detector)
        .loss(torch.zeros(3, 4).requires_grad_(), None, None)
        .requires_grad
    )


@pytest.mark.parametrize(
    ("recipe", "parameters", "line"),
    [
        ("best", {"queries": 100}, "recipe best does not use queries"),
        ("score-based", {"rounds": 3}, "recipe score-based does not use rounds"),
        ("score-based", {"queries": 1}, "queries is 1"),
        ("decision-based", {"objects": "vehicle1"}, "leave out objects"),
    ],
)
def test_bad_parameters(recipe, parameters, line):
    given = {"type": "detach", "recipe": recipe, "parameters": {"ratio": 0.1, **parameters}}
    with pytest.raises(UsageError, match=line):
        build_lidar_attack(attack_spec(given))


def test_it_needs_no_ground_truth():
    assert not Detach(ratio=0.1, recipe="score-based").needs_ground_truth
