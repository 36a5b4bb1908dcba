from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.gnss.drift import Drift


def test_to_the_left_by_two_decimetres_a_second(follow):
    """Heading north, left is west: after 0.3 s at 0.2 m/s, 0.06 m."""
    spoofed = follow(Drift(), [[0, k, 0] for k in range(5)], heading_rad=math.pi / 2, first=1)
    assert np.allclose(spoofed, [[0, 1, 0], [-0.02, 2, 0], [-0.04, 3, 0], [-0.06, 4, 0]])


def test_ends_at_its_bound(follow):
    spoofed = follow(Drift(rate_mps=20, angle_deg=0, most_m=5), [[0, 0, 0]] * 5)
    assert np.allclose(np.array(spoofed)[:, 0], [0, 2, 4, 5, 5])


@pytest.mark.parametrize("parameters", [{"rate_mps": float("nan")}, {"angle_deg": 400}, {"most_m": -1}])
def test_refuses(parameters):
    with pytest.raises(AdvpipeError, match=f"gnss-drift: {next(iter(parameters))} is"):
        Drift(**parameters)
