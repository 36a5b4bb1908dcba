"""A car in a random cloud, in front of a detector of random weights."""

from __future__ import annotations

import numpy as np
import pytest
from linear_detector import BOX


@pytest.fixture
def scene(make_cloud, make_boxes, make_detector):
    draw = np.random.default_rng(3)
    cloud = make_cloud(draw.uniform(0, 10, (800, 3)))
    cloud["intensity"] = draw.uniform(0, 1, 800)
    return cloud, make_boxes(BOX), make_detector(draw.uniform(0.1, 1, (10, 10, 10)), [BOX])
