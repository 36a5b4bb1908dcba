"""Shadowing that is correlated in space: one random field over the places of both ends of a link."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64

WAVES = 256


class ShadowField:
    """Standard normal shadowing of every link, whose autocorrelation is exp(-moved / correlation distance).

    `moved` is how far the ends of the link move in sum: Gudmundson's model (Electronics Letters 27(23), 1991)
    for both ends, as a sum of sinusoids over their places (Wang, Tameh and Nix, IEEE TVT 57(1), 2008). The
    same two places have the same shadowing at all times and in both directions; close links have similar
    ones.
    """

    def __init__(self, correlation_distance_m: float, rng: np.random.Generator) -> None:
        """Draw the sinusoids. Their wave vectors have the field's isotropic spectral density in the plane,
        the inverse of the exponential: a share of 1 - 1 / sqrt(1 + (k d)^2) is shorter than k."""
        self._correlation_distance_m = correlation_distance_m
        self._vectors = [self._wave_vectors(rng) for _ in range(2)]
        self._phases = rng.uniform(0, 2 * np.pi, WAVES)

    def normal(self, places_m: Float64) -> Float64:
        """The field (S, S) between places (S, 2 or more): zero mean, variance 1, symmetric."""
        sent = places_m[:, :2] @ self._vectors[0].T + self._phases
        received = places_m[:, :2] @ self._vectors[1].T
        one_way = np.cos(sent) @ np.cos(received).T - np.sin(sent) @ np.sin(received).T
        one_way *= np.sqrt(2 / WAVES)
        apart_m = np.linalg.norm(places_m[:, None, :2] - places_m[None, :, :2], axis=2)
        variance = 2 * (1 + np.exp(-2 * apart_m / self._correlation_distance_m))
        # The two ways of a link are independent unless its ends are near each other.
        both: Float64 = (one_way + one_way.T) / np.sqrt(variance)
        return both

    def _wave_vectors(self, rng: np.random.Generator) -> Float64:
        """Wave vectors (WAVES, 2), in radians per metre; one length in each of as many equal shares."""
        shares = (rng.permutation(WAVES) + rng.uniform(size=WAVES)) / WAVES
        lengths = np.sqrt(1 / np.square(1 - shares) - 1) / self._correlation_distance_m
        turns = rng.uniform(0, 2 * np.pi, WAVES)
        return np.column_stack([lengths * np.cos(turns), lengths * np.sin(turns)])
