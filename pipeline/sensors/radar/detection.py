"""Detection in noise: Swerling's fluctuation, and a cell-averaging CFAR in closed form.

Powers are in units of the mean noise of a cell, which is exponentially distributed after a square-law
detector. CFAR: Finn and Johnson (RCA Review 1968), Rohling (IEEE Trans. AES 19, 1983), Gandhi and Kassam
(IEEE Trans. AES 24, 1988). Fluctuation: Swerling, Probability of detection for fluctuating targets (IRE
Trans. IT 6, 1960). A scan is one coherent look.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]

STATED_PROBABILITY = 0.9
"""Of detection, at the range that a radar's section states."""


def threshold_factor(false_alarm_probability: float, cells: int) -> float:
    """alpha = N (P_fa^(-1/N) - 1): the threshold is alpha times the mean of N cells with noise."""
    return float(cells * (false_alarm_probability ** (-1 / cells) - 1))


def detection_probability(snr: npt.ArrayLike, false_alarm_probability: float, cells: int) -> Float64:
    """Of a target of Swerling's case 1 with the mean SNR (...): (1 + alpha / (N (1 + SNR)))^-N."""
    alpha = threshold_factor(false_alarm_probability, cells)
    return np.asarray((1 + alpha / (cells * (1 + np.asarray(snr, np.float64)))) ** -cells)


def needed_snr(probability: float, false_alarm_probability: float, cells: int) -> float:
    """The mean SNR that is detected with this probability: the inverse of `detection_probability`."""
    alpha = threshold_factor(false_alarm_probability, cells)
    return float(alpha / (cells * (probability ** (-1 / cells) - 1)) - 1)


def fluctuation(case: int, count: int, rng: np.random.Generator) -> Float64:
    """Factors (count,) of mean 1 on the RCS: exponential in case 1, chi-square of 4 degrees in case 3, none
    in case 0."""
    if case == 1:
        return rng.standard_exponential(count)
    return rng.standard_gamma(2.0, count) / 2 if case == 3 else np.ones(count)


def received_power(signal: Float64, rng: np.random.Generator) -> Float64:
    """Power (K,) in cells with signals (K,): signal and noise add as complex amplitudes."""
    noise = rng.standard_normal((2, len(signal))) * math.sqrt(0.5)
    return np.asarray((np.sqrt(signal) + noise[0]) ** 2 + noise[1] ** 2)


def thresholds(alpha: float, cells: int, count: int, rng: np.random.Generator) -> Float64:
    """Thresholds (count,) of the CFAR, each from noise in its own neighbouring cells."""
    return alpha / cells * rng.standard_gamma(cells, count)


def false_alarm_powers(alpha: float, cells: int, count: int, rng: np.random.Generator) -> Float64:
    """Powers (count,) of cells with noise alone that exceed their thresholds.

    The noise exceeds a threshold t with probability exp(-t), so that of false alarms the sum over the
    neighbouring cells is a gamma variate of rate 1 + alpha / N; the excess is exponential, without memory.
    """
    level = rng.standard_gamma(cells, count) * alpha / (cells + alpha)
    return np.asarray(level + rng.standard_exponential(count))
