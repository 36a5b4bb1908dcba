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
    assert DriftAware().allowed_nis() == pytest.approx(0.7 * 16.266, abs=1e-3)


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


def test_without_a_rate_only_the_test_limits_it(follow):
    """Allowed is 1 with variance 4: from the first fix on 2 m, and 5 m where the filter has followed 3 m."""
    attack = DriftAware(share=1 / 16.26623619623813)
    seen = [innovation([0, y, 0], 4) for y in (0, 0, -3)]
    spoofed = np.array(follow(attack, [[0, 0, 0]] * 3, innovations=seen))
    assert np.allclose(spoofed[:, 1], [2, 2, 5], atol=1e-6)


def test_one_that_knows_the_window_leaves_room_for_the_fixes_before():
    """Of two fixes, the sum may be 0.7 of chi-square's 99.9 % quantile with 6 degrees of freedom, 22.458."""
    attack = DriftAware(monitor="window", window_fixes=2)
    assert attack.allowed_nis([100.0, 5.0]) == pytest.approx(0.7 * 22.458 - 5.0, abs=1e-3)
    assert attack.allowed_nis([1.0]) == pytest.approx(
        0.7 * 16.266, abs=1e-3
    )  # the single fix's, which is less
    assert attack.allowed_nis() == pytest.approx(0.7 * 16.266, abs=1e-3)


def test_one_that_knows_the_window_drifts_more_slowly(follow):
    """After fixes with 3 each, 0.7 * 99.607 - 19 * 3 = 12.72 are left, more than one fix may have, 11.39;
    after fixes with 3.4 each 5.12, of which the offset is the root."""
    for past, offset_m in ((3.0, 11.386**0.5), (3.4, 5.125**0.5)):
        attack = DriftAware(monitor="window")
        spoofed = follow(attack, [[0, 0, 0]], innovations=[innovation([0, 0, 0])], past_nis=[past] * 50)
        assert spoofed[0][1] == pytest.approx(offset_m, abs=1e-3)


def test_never_beyond_its_bound(follow):
    attack = DriftAware(rate_mps=5, most_m=0.7, angle_deg=0)
    spoofed = np.array(follow(attack, [[0, 0, 0]] * 4, innovations=[innovation([0, 0, 0])] * 4))
    assert np.allclose(spoofed[:, 0], [0, 0.5, 0.7, 0.7])


@pytest.mark.parametrize(
    "parameters",
    [{"share": 0.0}, {"gate_probability": 1.0}, {"rate_mps": math.nan}, {"most_m": -2}, {"monitor": "x"}],
)
def test_refuses(parameters):
    with pytest.raises(AdvpipeError, match=f"gnss-drift-aware: {next(iter(parameters))} is"):
        DriftAware(**parameters)
