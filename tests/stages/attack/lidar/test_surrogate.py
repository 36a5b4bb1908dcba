"""Which attacks get the shipped detector as a surrogate, and how it is shown clouds."""

from __future__ import annotations

import numpy as np
import pytest
from framing_detector import ATTACKS, Framing
from linear_detector import Shipped

from advpipe.pipeline.adversary.surrogate import SurrogateDetector, proposing
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.protocol import VoxelDetector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.stages.attack.lidar.surrogate import with_surrogate

PLACES = np.zeros((0, 3), np.float32)


def seen(attack, detector, adaptation=None):
    return with_surrogate(attack, detector, adaptation or Adaptation(), PLACES, CPU)


@pytest.mark.parametrize("name", ATTACKS)
@pytest.mark.parametrize("recipe", ["best", "hide", "robust", "transfer"])
def test_a_detector_without_occupancy_loss_gets_the_shipped_one_beside_it(name, recipe):
    victim = Framing()
    found = seen(ATTACKS[name](recipe=recipe), victim)
    assert isinstance(found, SurrogateDetector)
    assert found.detector is victim
    assert found.surrogate.voxel_grid == load_detector("small").voxel_grid


@pytest.mark.parametrize("name", ATTACKS)
@pytest.mark.parametrize("recipe", ["random-best", "random", "paper", "score-based", "decision-based"])
def test_other_recipes_get_the_detector_alone(name, recipe):
    victim = Framing()
    assert seen(ATTACKS[name](recipe=recipe), victim) is victim


def test_a_detector_on_voxels_needs_no_surrogate():
    victim = Shipped()
    assert seen(ATTACKS["detach"](), victim) is victim


def test_the_surrogate_sees_clouds_at_the_height_that_it_expects():
    """A LiDAR 1.3 m above the ground is half a metre lower than the shipped detector's."""
    found = seen(ATTACKS["detach"](), Framing(), Adaptation(lidar_height_m=1.3))
    grid = proposing(found).voxel_grid
    assert isinstance(found.surrogate, VoxelDetector)
    point = np.array([[10.0, 0.0, 0.01]], np.float32)
    plain = load_detector("small").voxel_grid
    assert (grid.cells(point) == plain.cells(point + [[0, 0, -0.5]])).all()
