from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.gnss.jump import Jump

STILL = [[0, 0, 0]] * 1000


def test_glitches_of_five_metres_one_in_fifty(follow):
    """1000 fixes with probability 0.02: 20 on average, standard deviation 4.4."""
    distances = np.linalg.norm(follow(Jump(), STILL), axis=1)
    jumped = distances > 0
    assert 7 <= jumped.sum() <= 34
    assert np.allclose(distances[jumped], 5)


def test_steps_add_up(follow):
    spoofed = np.array(follow(Jump(mode="step", distance_m=2, probability=0.02), STILL))
    steps = np.linalg.norm(np.diff(spoofed, axis=0), axis=1)
    assert np.allclose(steps[steps > 0], 2)
    assert np.linalg.norm(spoofed[-1] - spoofed[0]) > 2  # more than 7 steps in random directions
    assert not spoofed[:, 2].any()


def test_every_span_jumps_at_least_once(follow):
    """Of spans of 20 fixes, two thirds would go by without a jump."""
    for seed in range(20):
        spoofed = np.linalg.norm(follow(Jump(), STILL[:20], seed=seed), axis=1)
        assert spoofed[0] == pytest.approx(5)


def test_always_and_never(follow):
    assert np.allclose(np.linalg.norm(follow(Jump(probability=1), STILL[:5]), axis=1), 5)
    assert not np.any(follow(Jump(probability=0), STILL[:5]))


def test_refuses():
    with pytest.raises(AdvpipeError, match=r"gnss-jump: probability is 1\.5; it takes a number, 0 to 1"):
        Jump(probability=1.5)
    with pytest.raises(AdvpipeError, match="mode is 'hop'"):
        Jump(mode="hop")
