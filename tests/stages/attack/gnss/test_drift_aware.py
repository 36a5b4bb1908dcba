from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.localisation.estimate import Innovation
from advpipe.stages.attack.gnss.drift_aware import DriftAware, undetected_range_m

UNIT = np.array([0.0, 1.0, 0.0])


def innovation(residual, variance_m2=1.0) -> Innovation:
    residual = np.array(residual, dtype=float)
    return Innovation(residual, variance_m2 * np.eye(3), float(residual @ residual) / variance_m2, True)


def test_allowed_is_seven_tenths_of_the_gate():
    """The 99.9 % quantile of chi-square with 3 degrees of freedom is 16.266, in every table."""
    assert DriftAware().allowed_nis == pytest.approx(0.7 * 16.266, abs=1e-3)


def test_the_roots_of_the_parabola():
    """Variance 4, residual (3, 1, 0): nis(a) = (9 + (1 + a)^2) / 4 = 6.25 at a = 3 and a = -5."""
    assert np.allclose(undetected_range_m(innovation([3, 1, 0], 4), UNIT, 6.25), (-5, 3))
    # 9 / 4 is the least that any offset leaves, at a = -1
    assert np.allclose(undetected_range_m(innovation([3, 1, 0], 4), UNIT, 2.0), (-1, -1))


def test_grows_as_fast_as_it_may(follow):
    """Allowed is 1: with 0, 0, 0.85, 2, -0.5 m to the left already, 1, 1, 0.15, -1 and 1.5 m more pass."""
    attack = DriftAware(rate_mps=5, share=1 / 16.26623619623813)
    seen = [innovation([0, y, 0]) for y in (0, 0, 0.85, 2, -0.5)]
    spoofed = np.array(follow(attack, [[0, 0, 0]] * 5, innovations=seen))
    assert np.allclose(spoofed[:, 1], [0, 0.5, 0.15, 0, 0.5], atol=1e-6)
    assert np.allclose(spoofed[:, [0, 2]], 0)


def test_never_beyond_its_bound(follow):
    attack = DriftAware(rate_mps=5, most_m=0.7, angle_deg=0)
    spoofed = np.array(follow(attack, [[0, 0, 0]] * 4, innovations=[innovation([0, 0, 0])] * 4))
    assert np.allclose(spoofed[:, 0], [0, 0.5, 0.7, 0.7])


@pytest.mark.parametrize(
    "parameters", [{"share": 0.0}, {"gate_probability": 1.0}, {"rate_mps": math.nan}, {"most_m": -2}]
)
def test_refuses(parameters):
    with pytest.raises(AdvpipeError, match=f"gnss-drift-aware: {next(iter(parameters))} is"):
        DriftAware(**parameters)
