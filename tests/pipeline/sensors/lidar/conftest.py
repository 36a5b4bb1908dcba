"""Hits made by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from advpipe.pipeline.sensors.world import Hits
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID, REFLECTIVITY, RETROREFLECTIVE


@pytest.fixture
def facing() -> Callable[..., Hits]:
    """So many rays that meet one material at one range."""

    def hits(count: int, range_m: float, material: str, cos: float = 1.0, transmission: float = 1.0) -> Hits:
        return Hits(
            np.full(count, range_m, np.float32),
            np.full(count, cos, np.float32),
            np.full(count, REFLECTIVITY[MATERIAL_ID[material]]),
            np.full(count, RETROREFLECTIVE[MATERIAL_ID[material]]),
            np.full(count, transmission, np.float32),
            np.full(count, -1, np.int32),
            np.zeros(0, np.float32),
        )

    return hits
