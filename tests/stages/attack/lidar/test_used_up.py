"""A loss that flattens on the way: what an attack has reached by then is not thrown away."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from linear_detector import BOX, LinearVoxelDetector

from advpipe.pipeline.detector.protocol import OccupancyLoss
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import Perturb


class Hinge(LinearVoxelDetector):
    """Its loss no longer depends on the points once a tenth of the clean cloud's score is gone."""

    full = None

    def _hinged(self, scores):
        self.full = scores.sum().item() if self.full is None else self.full
        return -torch.relu(scores.sum() - 0.9 * self.full)

    def loss(self, points, boxes, labels):
        return self._hinged(self._scores(points, boxes, torch.zeros(0, 4))[0])

    def occupancy_loss(self, points, boxes, labels, probes=None):
        none = torch.zeros(0, 4)
        scores, occupancy, row = self._scores(points, boxes, none if probes is None else probes)
        return OccupancyLoss(self._hinged(scores), occupancy, row)


@pytest.fixture
def scene(make_cloud, make_boxes):
    draw = np.random.default_rng(3)
    weights = draw.uniform(0.1, 1, (10, 10, 10))
    return make_cloud(draw.uniform(0, 10, (800, 3))), make_boxes(BOX), Hinge(weights, [BOX])


def test_detach_still_spends_its_budget(scene):
    result = Detach(ratio=0.2)(*scene, np.random.default_rng(0))
    assert len(result.labels) == 160
    assert result.note == "nothing more to gain: the rest removed at random"


@pytest.mark.parametrize("recipe", ["best", "paper"])
def test_perturb_keeps_what_it_moved(scene, recipe):
    attack = Perturb(eps_cm=60, recipe=recipe)
    attack.settings = type(attack.settings)(keep_best=False)  # this detector's score stays where it is: at 1
    result = attack(*scene, np.random.default_rng(0))
    assert result.loss_before < -1
    assert result.loss_after > result.loss_before
    assert len(result.labels) > 0


@pytest.mark.parametrize("attack", [Detach(ratio=0.2), Perturb(eps_cm=60)])
def test_no_gradient_from_the_start_is_said(scene, attack):
    cloud, boxes, detector = scene
    detector.full = 1e9
    result = attack(cloud, boxes, detector, np.random.default_rng(0))
    assert result.cloud.tobytes() == cloud.tobytes()
    assert "no gradient" in result.note
