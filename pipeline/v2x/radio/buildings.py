"""Buildings that attenuate signals: walls crossed and metres inside."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.core.index_ranges import index_ranges
from advpipe.pipeline.geometry.transforms import Float64

Bool = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]

_TURN = 2 * np.pi
_SECTORS = 1024
"""Of the full turn around a sender; walls meet only receivers in the sectors that they fill."""
_MARGIN_RAD = 1e-9


class Buildings:
    """Footprints in the map's plane, as seen from above: walls crossed and metres inside.

    A line's length inside is the signed sum of the places where it crosses walls: plus for leaving
    and minus for entering; an end that lies inside counts as left there. So no polygon has to be clipped.
    """

    def __init__(self, footprints: Sequence[shapely.Polygon]) -> None:
        oriented = shapely.orient_polygons(np.array(footprints, dtype=object))
        self._tree = shapely.STRtree(oriented)
        corners = [
            shapely.get_coordinates(ring)
            for polygon in oriented
            for ring in (polygon.exterior, *polygon.interiors)
        ]
        self._start = np.concatenate([np.empty((0, 2)), *(ring[:-1] for ring in corners)])
        self._end = np.concatenate([np.empty((0, 2)), *(ring[1:] for ring in corners)])
        begin = np.cumsum([0, *(len(ring) - 1 for ring in corners)])
        turns = [np.roll(np.arange(first, last), -1) for first, last in pairwise(begin)]
        self._next = np.concatenate([np.empty(0, np.int64), *turns])

    def crossings(
        self, senders_m: Float64, receivers_m: Float64, wanted: Bool | None = None
    ) -> tuple[Float64, Float64]:
        """Walls crossed (T, S) and metres inside (T, S) from places (T, 2) to places (S, 2).

        wanted: (T, S), the pairs to compute; the others are zero.
        """
        if wanted is None:
            wanted = np.ones((len(senders_m), len(receivers_m)), np.bool_)
        row, edge, column = self._candidates(senders_m, receivers_m, wanted)
        origin = np.ascontiguousarray(senders_m.T)[:, row]
        ray_x, ray_y = receivers_m.T[:, column] - origin
        start_x, start_y = self._start.T[:, edge] - origin
        end_x, end_y = self._end.T[:, edge] - origin
        start_side = ray_x * start_y - ray_y * start_x
        end_side = ray_x * end_y - ray_y * end_x
        # A corner on the line belongs to one side, so that only one of the two walls that meet there is
        # crossed.
        (met,) = np.nonzero((start_side > 0) != (end_side > 0))
        across = end_side[met] - start_side[met]
        place = (start_x[met] * end_y[met] - start_y[met] * end_x[met]) / across
        hit = (place >= 0) & (place < 1)
        cell, place = (row * len(receivers_m) + column)[met[hit]], place[hit]
        signed = np.where(across[hit] > 0, place, -place)
        walls = np.bincount(cell, minlength=wanted.size).reshape(wanted.shape)
        inside = np.bincount(cell, signed, minlength=wanted.size).reshape(wanted.shape)
        inside = inside + wanted * self._containing(receivers_m)
        length_m = np.linalg.norm(receivers_m - senders_m[:, None], axis=2)
        return walls.astype(np.float64), np.maximum(inside, 0.0) * length_m

    def _candidates(
        self, senders_m: Float64, receivers_m: Float64, wanted: Bool
    ) -> tuple[Int64, Int64, Int64]:
        """Sender, wall and receiver, where the receiver lies in or next to the angle that the wall fills."""
        first = _angles(senders_m, self._start)
        last = first[:, self._next]
        width = np.remainder(last - first + np.pi, _TURN) - np.pi
        low = np.where(width >= 0, first, last)
        rows = 2 * _SECTORS * np.arange(len(senders_m))[:, None]
        begin = rows + _sectors(low - _MARGIN_RAD)
        end = rows + _sectors(low + np.abs(width) + _MARGIN_RAD) + 1

        row, column = np.nonzero(wanted)
        sector = np.minimum(_sectors(_angles(senders_m, receivers_m)[row, column]), _SECTORS - 1)
        sector += rows[row, 0]
        sector = np.concatenate([sector, sector + _SECTORS])  # once more, a turn later
        order = np.argsort(sector, kind="stable")
        before = np.concatenate([[0], np.cumsum(np.bincount(sector, minlength=rows.size * 2 * _SECTORS))])
        counts = (before[end] - before[begin]).ravel()
        which = np.repeat(np.arange(len(counts)), counts)
        found = order[index_ranges(before[begin].ravel(), counts)] % len(column)
        return *np.divmod(which, len(self._start)), column[found]

    def _containing(self, points_m: Float64) -> Int64:
        """The number of footprints (S,) that contain each point."""
        points, _ = self._tree.query(shapely.points(points_m), predicate="within")
        return np.bincount(points, minlength=len(points_m))


def _angles(origins_m: Float64, points_m: Float64) -> Float64:
    """Directions (T, P) of points (P, 2) as seen from the origins (T, 2)."""
    delta_m = points_m - origins_m[:, None]
    return np.arctan2(delta_m[..., 1], delta_m[..., 0])


def _sectors(angles_rad: Float64) -> Int64:
    """Whole numbers from 0 for -pi on; just below, the first as well."""
    return np.maximum((angles_rad + np.pi) * (_SECTORS / _TURN), 0).astype(np.int64)
