"""Makes `published_attacks` importable, and draws a road for it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.roads import RoadMap, lanes

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def road() -> RoadMap:
    """Two lanes to the east, at y = 0 and 3, and two to the west, at 6 and 9, each 3 m wide and 1 km long."""
    east = [(np.array([[-100.0, y_m], [900.0, y_m]]), 3.0) for y_m in (0.0, 3.0)]
    west = [(np.array([[900.0, y_m], [-100.0, y_m]]), 3.0) for y_m in (6.0, 9.0)]
    return lanes([*east, *west])
