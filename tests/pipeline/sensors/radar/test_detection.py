"""Fluctuation and CFAR against scipy's distributions, and against numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from advpipe.pipeline.sensors.radar.detection import (
    detection_probability,
    false_alarm_powers,
    fluctuation,
    needed_snr,
    received_power,
    threshold_factor,
    thresholds,
)

COUNT = 60_000
LEAST_P = 1e-3


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_threshold_factor_by_hand() -> None:
    assert threshold_factor(0.01, 2) == pytest.approx(2 * (10 - 1))
    assert threshold_factor(1e-6, 10**9) == pytest.approx(-np.log(1e-6), rel=1e-6)  # noise that is known


@pytest.mark.parametrize(
    ("case", "law"), [(1, stats.expon()), (3, stats.gamma(2, scale=0.5))], ids=["case 1", "case 3"]
)
def test_swerlings_distributions(case: int, law: stats.rv_continuous, rng: np.random.Generator) -> None:
    assert stats.kstest(fluctuation(case, COUNT, rng), law.cdf).pvalue > LEAST_P
    assert (fluctuation(0, 3, rng) == 1).all()


@pytest.mark.parametrize("snr", [0.0, 3.0, 20.0])
def test_signal_and_noise_add_as_amplitudes(snr: float, rng: np.random.Generator) -> None:
    """Twice the power is a non-central chi-square variate of 2 degrees of freedom (Rice)."""
    power = received_power(np.full(COUNT, snr), rng)
    assert stats.kstest(2 * power, stats.ncx2(2, max(2 * snr, 1e-12)).cdf).pvalue > LEAST_P


@pytest.mark.parametrize(("probability", "cells"), [(1e-2, 4), (1e-3, 16)])
def test_false_alarm_rate_is_that_of_the_threshold(
    probability: float, cells: int, rng: np.random.Generator
) -> None:
    count = 400_000
    limits = thresholds(threshold_factor(probability, cells), cells, count, rng)
    alarms = int((received_power(np.zeros(count), rng) > limits).sum())
    assert stats.binomtest(alarms, count, probability).pvalue > LEAST_P


@pytest.mark.parametrize("snr", [5.0, 50.0])
def test_detection_probability_of_a_fluctuating_target(snr: float, rng: np.random.Generator) -> None:
    signal = snr * fluctuation(1, COUNT, rng)
    limits = thresholds(threshold_factor(1e-4, 16), 16, COUNT, rng)
    detected = int((received_power(signal, rng) > limits).sum())
    expected = float(detection_probability(snr, 1e-4, 16))
    assert stats.binomtest(detected, COUNT, expected).pvalue > LEAST_P
    assert needed_snr(expected, 1e-4, 16) == pytest.approx(snr)


def test_powers_of_false_alarms_are_those_of_noise_beyond_its_threshold(rng: np.random.Generator) -> None:
    alpha, cells = threshold_factor(1e-2, 8), 8
    noise, limits = rng.standard_exponential(600_000), thresholds(alpha, cells, 600_000, rng)
    drawn = false_alarm_powers(alpha, cells, 20_000, rng)
    assert stats.ks_2samp(drawn, noise[noise > limits]).pvalue > LEAST_P
