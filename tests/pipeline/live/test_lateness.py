"""How late messages were."""

import numpy as np
import pytest

from advpipe.pipeline.live.lateness import Lateness


def test_percentiles_are_those_of_all_values() -> None:
    late_s = np.random.default_rng(1).exponential(0.01, 5000)
    lateness = Lateness()
    for value in late_s.tolist():
        lateness.add(value)
    for percent in (1, 50, 99):
        assert lateness.percentile_s(percent) == pytest.approx(np.percentile(late_s, percent), abs=2e-4)
    assert lateness.max_s == late_s.max()


def test_none_early_and_hours() -> None:
    lateness = Lateness()
    assert lateness.percentile_s(50) == lateness.max_s == 0
    lateness.add(-1e-9)
    assert lateness.percentile_s(99) == 0
    for late_s in (5.0, 5.0, 5.0, 7200.0):
        lateness.add(late_s)
    assert lateness.percentile_s(50) == pytest.approx(5, abs=0.02)
    assert lateness.percentile_s(100) == 7200
    assert lateness.max_s == 7200
