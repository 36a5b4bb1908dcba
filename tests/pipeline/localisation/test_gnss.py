"""The receiver errs as much as its model says, and its error wanders as slowly."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.localisation.gnss import GnssReceiver
from advpipe.pipeline.localisation.section import GnssSensor


def test_errors_have_the_stated_covariance() -> None:
    sensor = GnssSensor(white_stddev_m=0.5, drift_stddev_m=1.2, drift_time_s=10)
    receivers = [GnssReceiver(sensor, 0.1, np.random.default_rng(seed)) for seed in range(4000)]
    errors = np.array([receiver.fix(np.array([5.0, 6.0, 7.0])) for receiver in receivers]) - (5, 6, 7)
    assert np.diag(receivers[0].covariance_m2) == pytest.approx([1.69, 1.69, 6.76])
    assert np.var(errors, axis=0) == pytest.approx([1.69, 1.69, 6.76], rel=0.1)


def test_the_offset_decays_with_its_time_constant() -> None:
    sensor = GnssSensor(white_stddev_m=0.0, drift_stddev_m=1.0, drift_time_s=20)
    receiver = GnssReceiver(sensor, 1.0, np.random.default_rng(3))
    errors = np.array([receiver.fix(np.zeros(3))[0] for _ in range(60_000)])
    correlation = np.mean(errors[:-20] * errors[20:]) / np.var(errors)
    assert correlation == pytest.approx(np.exp(-1), abs=0.06)
