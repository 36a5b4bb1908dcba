from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.gnss.bias import Bias


def test_one_vector_for_all_fixes(follow):
    spoofed = follow(Bias(bound_m=3, bound_up_m=0), [[0, 0, 5], [10, 0, 5], [20, 2, 5]])
    deltas = np.array(spoofed) - [[0, 0, 5], [10, 0, 5], [20, 2, 5]]
    assert np.allclose(deltas, deltas[0])
    assert deltas[0, 2] == 0
    assert 0 < np.abs(deltas[0, :2]).max() <= 3


def test_uniform_within_the_bounds(follow):
    """Of U(-4, 4): mean 0, standard deviation 4 / sqrt(3) = 2.309."""
    deltas = np.array(
        [follow(Bias(bound_m=4, bound_up_m=8), [[0, 0, 0]], seed=seed)[0] for seed in range(2000)]
    )
    assert np.abs(deltas[:, :2]).max() <= 4
    assert 7.9 < np.abs(deltas[:, 2]).max() <= 8
    assert np.allclose(deltas[:, :2].mean(axis=0), 0, atol=0.2)
    assert np.allclose(deltas.std(axis=0), np.array([4, 4, 8]) / np.sqrt(3), rtol=0.05)


@pytest.mark.parametrize("bound", [float("nan"), float("inf"), -1.0, True, "3"])
def test_refuses_bounds_that_are_none(bound):
    with pytest.raises(AdvpipeError, match="gnss-bias: bound_m is"):
        Bias(bound_m=bound)
