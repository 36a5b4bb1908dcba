"""Rectangles on a grid, so that those around each of many points are found without comparing all with all."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.index_ranges import index_ranges

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

CELLS = (128, 128)
_SLACK = 0.004
"""Cells by which rectangles are widened, as points are rounded to single precision."""


class RectangleMap:
    """The rectangles between the corners low_m and high_m (M, 2) of a plane; none where one is not below.

    cells: of the grid over all of them in each direction, 60,000 in all at most. An empty margin of one cell
    is around it.
    """

    def __init__(self, low_m: Float64, high_m: Float64, cells: tuple[int, int] = CELLS) -> None:
        start_m, end_m = low_m.min(axis=0, initial=np.inf), high_m.max(axis=0, initial=-np.inf)
        self._cells = cells
        self._start_m = start_m = np.where(np.isfinite(start_m), start_m, 0.0)
        self._per_m = (np.array(cells) - 2 * _SLACK) / np.maximum(end_m - start_m, 1e-9)
        first = np.floor((low_m - start_m) * self._per_m).astype(np.int64) + 1
        last = np.floor((high_m - start_m) * self._per_m + 2 * _SLACK).astype(np.int64) + 1
        last = last.clip(max=cells)
        sides = (last - first + 1) * (low_m <= high_m).all(axis=1, keepdims=True)
        counts = sides.prod(axis=1)
        rectangle = np.repeat(np.arange(len(counts)), counts)
        place = index_ranges(np.zeros_like(counts), counts)
        column, row = np.divmod(place, sides[rectangle, 1])
        self._row = cells[1] + 2
        cell = (column + first[rectangle, 0]) * self._row + row + first[rectangle, 1]
        self._rectangles = rectangle[np.argsort(cell.astype(np.uint16), kind="stable")]
        """Those that meet each cell, in their order, cell by cell."""
        self._counts = np.bincount(cell, minlength=(cells[0] + 2) * self._row)
        self._starts = np.cumsum(self._counts) - self._counts
        self._is_met = self._counts > 0

    def __len__(self) -> int:
        """How many pairs of a cell and a rectangle there are."""
        return len(self._rectangles)

    def pairs(self, first_m: Float32, second_m: Float32) -> tuple[Int64, Int64]:
        """Indices (K,) of points (N,), in their order, and of the rectangles that meet their cells.

        They are a superset of the pairs of a point and a rectangle around it.
        """
        place = np.floor(self._places(first_m, 0))
        place *= np.float32(self._row)
        place += self._places(second_m, 1)
        cell = place.astype(np.intp)
        inside = np.flatnonzero(np.take(self._is_met, cell, mode="clip"))
        cell = np.take(cell, inside)
        counts = np.take(self._counts, cell)
        pairs = index_ranges(np.take(self._starts, cell), counts)
        return np.repeat(inside, counts), np.take(self._rectangles, pairs, mode="clip")

    def _places(self, places_m: Float32, axis: int) -> Float32:
        """The fractional column or row (N,) of places (N,); below 1 and in the last one beside the grid."""
        found = places_m - np.float32(self._start_m[axis])
        found *= np.float32(self._per_m[axis])
        found += np.float32(1 + _SLACK)
        np.clip(found, 0, np.float32(self._cells[axis] + 1), out=found)
        return found
