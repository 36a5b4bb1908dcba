"""Random gain: log-normal shadowing and Nakagami fading."""

from __future__ import annotations

from functools import cache

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64

NAKAGAMI_UP_TO_M = np.array([4.7, 11.7, 28.9, 71.6, 177.3])
NAKAGAMI_SHAPES = (3.01, 1.18, 1.94, 1.86, 0.45, 0.32)
"""Shape m up to each of these distances, and beyond the last (Cheng et al., IEEE JSAC 25(8), 2007)."""

_LOGITS = np.linspace(-37.5, 37.5, 3001)
"""Logits of the tabulated quantiles; the first and the last lie beyond all uniform draws of 53 bits."""


def shadowing_db(uniform: Float64, stddev_db: Float64) -> Float64:
    """Normal in decibels, from draws in (0, 1)."""
    from scipy.special import ndtri

    normal: Float64 = ndtri(uniform)
    normal *= stddev_db
    return normal


def nakagami_db(uniform: Float64, distance_m: Float64) -> Float64:
    """Gain of the power, gamma distributed with shape m(distance) and mean 1, from draws in (0, 1).

    Linear between tabulated quantiles, evenly spaced in the draw's logit: in the lower tail the gain in
    decibels is linear in it. Within 0.01 dB.
    """
    places = np.log(uniform)
    places -= np.log1p(-uniform)
    places -= _LOGITS[0]
    places /= _LOGITS[1] - _LOGITS[0]
    starts = places.astype(np.int64)
    places -= starts
    shape = np.zeros(distance_m.shape, np.uint8)
    for edge_m in NAKAGAMI_UP_TO_M:  # faster than a binary search
        shape += (distance_m > edge_m).view(np.uint8)
    table_db, steps_db = _quantiles_db()
    starts += shape * np.int64(table_db.shape[1])
    gain_db: Float64 = steps_db.take(starts)
    gain_db *= places
    gain_db += table_db.take(starts)
    return gain_db


@cache
def _quantiles_db() -> tuple[Float64, Float64]:
    """One row for each shape: 10 log10 of the power at each of the logits, and the steps to the next."""
    from scipy.special import expit, gammainccinv, gammaincinv

    shapes = np.array(NAKAGAMI_SHAPES)[:, None]
    lower, upper = gammaincinv(shapes, expit(_LOGITS)), gammainccinv(shapes, expit(-_LOGITS))
    quantiles: Float64 = 10 * np.log10(np.where(_LOGITS < 0, lower, upper) / shapes)
    return quantiles, np.diff(quantiles, append=quantiles[:, -1:])
