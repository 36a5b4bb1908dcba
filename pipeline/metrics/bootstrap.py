"""Confidence intervals for metrics of a drive, by a paired bootstrap over blocks of time.

Neighbouring frames show nearly the same scene, so single frames are not independent; blocks of at least 5 s
are drawn instead. Each draw applies to the clean, the attacked and the baseline frames alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]

MIN_BLOCK_S = 5.0


def time_blocks(stamps_ns: npt.ArrayLike, min_block_s: float = MIN_BLOCK_S) -> list[Int64]:
    """Divide frames, given by ascending stamps (F,) in ns, into blocks of at least `min_block_s`.

    A block ends before the first frame that is `min_block_s` or more after its start. A remainder that is too
    short is added to the previous block. The last frame's duration is the median frame's. Returns the indices
    of the frames of each block.
    """
    stamps = np.asarray(stamps_ns, dtype=np.int64)
    if not len(stamps):
        return []
    least_ns = round(min_block_s * 1e9)
    starts = [0]
    for i, stamp in enumerate(stamps):
        if stamp - stamps[starts[-1]] >= least_ns:
            starts.append(i)
    period_ns = int(np.median(np.diff(stamps))) if len(stamps) > 1 else 0
    if len(starts) > 1 and stamps[-1] + period_ns - stamps[starts[-1]] < least_ns:
        starts.pop()
    return np.split(np.arange(len(stamps)), starts[1:])


@dataclass(frozen=True)
class BlockBootstrap:
    """Draws of blocks with replacement; there are none if there are fewer than two blocks.

    times: (draws, B) int64, how often each draw contains each block. block: (F,) int64, each frame's block.
    """

    times: Int64
    block: Int64

    @classmethod
    def of(
        cls,
        stamps_ns: npt.ArrayLike,
        draws: int,
        rng: np.random.Generator,
        min_block_s: float = MIN_BLOCK_S,
    ) -> BlockBootstrap:
        """Draw the blocks of frames with these ascending stamps (F,) in ns."""
        blocks = time_blocks(stamps_ns, min_block_s)
        n = len(blocks)
        block = np.repeat(np.arange(n), [len(each) for each in blocks])
        if n < 2:
            return cls(np.zeros((0, n), dtype=np.int64), block)
        chosen = rng.integers(0, n, size=(draws, n))
        times = np.stack([(chosen == each).sum(axis=1) for each in range(n)], axis=1)
        return cls(times.astype(np.int64), block)

    @property
    def n_blocks(self) -> int:
        """The number of blocks that each draw takes."""
        return int(self.times.shape[1])

    @property
    def weights(self) -> Int64:
        """How often each draw contains each frame: (draws, F)."""
        return self.times[:, self.block]

    def samples(self, statistic: Callable[[Int64], Float64]) -> Float64:
        """The statistic (draws,) of all draws.

        statistic: maps the `times` (W, B) of W draws to (W,). It is computed once for equal draws.
        """
        distinct, row = self._distinct
        return statistic(distinct)[row] if len(distinct) else np.zeros(0)

    @cached_property
    def _distinct(self) -> tuple[Int64, Int64]:
        """The draws (W, B) without repetition, and which of them each draw is."""
        distinct, row = np.unique(self.times, axis=0, return_inverse=True)
        return distinct, row.reshape(-1)


def percentile_interval(samples: Float64, level: float = 0.95) -> tuple[float, float] | None:
    """The central interval that contains the share `level` of the finite samples; None if none is finite."""
    defined = samples[np.isfinite(samples)]
    if not len(defined):
        return None
    low, high = np.quantile(defined, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
