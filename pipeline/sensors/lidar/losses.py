"""Random numbers that decide which returns are lost: neighbouring rays share their fate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

PATCH_COLUMNS, PATCH_RINGS = 7.0, 1.2
"""Size of the patches: standard deviation of the smoothing, in columns and rings; a degree or two."""

SHARED = 0.9
"""Part of each ray's number that it shares with its patch; the rest, sqrt(1 - 0.9^2), is its own."""


class Patches:
    """Uniform numbers for the rays of one sensor's turns, alike within patches."""

    def __init__(self, columns: int, channels: int) -> None:
        """A tile of smooth noise, periodic in the columns; it is the same for each such sensor."""
        own, white = np.random.default_rng(20261127).standard_normal((2, columns, channels))
        spectrum = np.fft.fft2(white)
        for axis, (size, width) in enumerate(((columns, PATCH_COLUMNS), (channels, PATCH_RINGS))):
            fall = np.exp(-2 * (np.pi * np.fft.fftfreq(size) * width) ** 2)
            spectrum *= fall[:, None] if axis == 0 else fall[None]
        smooth = np.fft.ifft2(spectrum).real
        spread = smooth.std() or 1.0  # a single ray is like no other
        mixed = SHARED * smooth / spread + np.sqrt(1 - SHARED**2) * own
        self._channels = channels
        rank = np.empty(mixed.size)
        rank[np.argsort(mixed, axis=None)] = np.arange(mixed.size)
        self._tile = ((rank + 0.5) / mixed.size).astype(np.float32)

    def uniform(self, rng: np.random.Generator) -> Float32:
        """Numbers (R,) in [0, 1), each uniformly distributed; the patches lie elsewhere in each turn."""
        start = int(rng.integers(len(self._tile) // self._channels)) * self._channels
        uniform = np.concatenate([self._tile[start:], self._tile[:start]])
        return uniform if rng.random() < 0.5 else 1 - uniform
