"""Keyed random draws: each belongs to one message and one receiver, whatever else is on the air.

So an unchanged message has the same outcome when a drive is replayed with other messages changed. The
generator is counter-based: SplitMix64's output function (Steele, Lea and Flood, OOPSLA 2014) over the keys.
"""

from __future__ import annotations

import zlib

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64

Int64 = npt.NDArray[np.int64]
UInt64 = npt.NDArray[np.uint64]

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_FACTORS = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))


def mix(state: UInt64) -> UInt64:
    """SplitMix64's output for each state: a bijection in which every bit depends on every bit."""
    return _mixed(state.copy())


def _mixed(state: UInt64) -> UInt64:
    """As `mix`, in place."""
    shifted = state >> _SHIFTS[0]
    state ^= shifted
    for shift, factor in zip(_SHIFTS[1:], _FACTORS, strict=True):
        state *= factor
        state ^= np.right_shift(state, shift, out=shifted)
    return state


def message_keys(station_ids: npt.ArrayLike, times_ns: npt.ArrayLike, copies: npt.ArrayLike = 0) -> UInt64:
    """The keys of messages, from station id, generation time and a number for further copies.

    Other contents do not enter the key: an attack that changes only the payload does not change the draws.
    """
    parts = np.broadcast_arrays(*(np.asarray(part) for part in (station_ids, times_ns, copies)))
    station, time, copy = (np.atleast_1d(part).astype(np.int64).view(np.uint64) for part in parts)
    return mix(mix(mix(station + GOLDEN) + time) + copy).reshape(parts[0].shape)


class Draws:
    """Uniform random numbers for a drive's seed, keyed by use, message and receiver."""

    def __init__(self, seed: int) -> None:
        self._seed = named_generator(seed, "v2x", "radio").integers(2**64, dtype=np.uint64)
        self._uses: dict[str, np.uint64] = {}

    def of_messages(self, use: str, keys: UInt64) -> Float64:
        """One number (M,) in (0, 1) for each message."""
        return _uniform(_mixed(keys ^ self._of_use(use)))

    def of_pairs(self, use: str, keys: UInt64, receivers: UInt64) -> Float64:
        """Numbers in (0, 1) for messages (...) and receivers (...), whose shapes are broadcast."""
        return _uniform(_mixed(mix(keys ^ self._of_use(use)) + receivers * GOLDEN))

    def of_some_pairs(self, use: str, keys: UInt64, receivers: UInt64, row: Int64, column: Int64) -> Float64:
        """As `of_pairs` (N,) of messages (M,) in these rows (N,) and receivers (S,) in these columns (N,)."""
        state = mix(keys ^ self._of_use(use)).take(row)
        state += (receivers * GOLDEN).take(column)
        return _uniform(_mixed(state))

    def _of_use(self, use: str) -> np.uint64:
        if use not in self._uses:
            state = self._seed ^ np.uint64(zlib.crc32(use.encode()))
            self._uses[use] = np.uint64(mix(np.array([state]))[0])
        return self._uses[use]


def _uniform(bits: UInt64) -> Float64:
    """The middles of 2^53 equal parts of the unit interval, so never 0 or 1; overwrites the bits."""
    bits >>= np.uint64(11)
    uniform = bits.view(np.int64).astype(np.float64)
    uniform += 0.5
    uniform *= 2.0**-53
    return uniform
