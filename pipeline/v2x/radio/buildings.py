"""What buildings take from a signal that crosses them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.geometry.transforms import Float64

Bool = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]

_TURN = 2 * np.pi
_ROW, _NOWHERE = 40.0, 25.0
"""Angles of one sender are apart from those of the next; no edge is at the angle `_NOWHERE`."""


class Buildings:
    """Footprints in the map's plane, as seen from above: walls crossed and metres inside.

    A line's length inside is the sum over the walls it crosses, of where it does so, with plus for leaving
    and minus for entering; an end that lies inside counts as left there. So no polygon has to be cut.
    """

    def __init__(self, footprints: Sequence[shapely.Polygon]) -> None:
        oriented = shapely.orient_polygons(np.array(footprints, dtype=object))
        self._tree = shapely.STRtree(oriented)
        rings = [ring for polygon in oriented for ring in (polygon.exterior, *polygon.interiors)]
        corners = [shapely.get_coordinates(ring) for ring in rings]
        self._start = np.concatenate([np.empty((0, 2)), *(ring[:-1] for ring in corners)])
        self._end = np.concatenate([np.empty((0, 2)), *(ring[1:] for ring in corners)])

    def crossings(
        self, senders_m: Float64, receivers_m: Float64, wanted: Bool | None = None
    ) -> tuple[Float64, Float64]:
        """Walls crossed (T, S) and metres inside (T, S) from places (T, 2) to places (S, 2).

        wanted: (T, S), the pairs that matter; the others are zero.
        """
        if wanted is None:
            wanted = np.ones((len(senders_m), len(receivers_m)), np.bool_)
        row, edge, column = self._candidates(senders_m, receivers_m, wanted)
        origin, start = senders_m[row], self._start[edge]
        ray, wall = receivers_m[column] - origin, self._end[edge] - start
        across = _cross(ray, wall)
        with np.errstate(divide="ignore", invalid="ignore"):
            place = _cross(start - origin, wall) / across
        hit = (across != 0) & (place >= 0) & (place < 1)
        cell, place = (row * len(receivers_m) + column)[hit], place[hit]
        signed = np.where(across[hit] > 0, place, -place)
        walls = np.bincount(cell, minlength=wanted.size).reshape(wanted.shape)
        inside = np.bincount(cell, signed, minlength=wanted.size).reshape(wanted.shape)
        inside = inside + wanted * self._containing(receivers_m)
        length_m = np.linalg.norm(receivers_m - senders_m[:, None], axis=2)
        return walls.astype(np.float64), np.maximum(inside, 0.0) * length_m

    def _candidates(
        self, senders_m: Float64, receivers_m: Float64, wanted: Bool
    ) -> tuple[Int64, Int64, Int64]:
        """Sender, wall and receiver, where the receiver lies in the angle that the wall fills."""
        rows = np.arange(len(senders_m))[:, None]
        first, last = (_angles(senders_m, points) for points in (self._start, self._end))
        width = (last - first + np.pi) % _TURN - np.pi
        low = np.where(width >= 0, first, last) + _ROW * rows
        angles = np.where(wanted, _angles(senders_m, receivers_m), _NOWHERE)
        order = np.argsort(angles, axis=1, kind="stable")
        angles = np.take_along_axis(angles, order, axis=1)
        angles = np.hstack([angles, np.where(angles < _NOWHERE, angles + _TURN, _NOWHERE)]) + _ROW * rows
        flat = angles.ravel()
        margin = 1e-9  # of rounding; what is not crossed after all drops out later
        begin = np.searchsorted(flat, low.ravel() - margin)
        counts = np.searchsorted(flat, (low + np.abs(width)).ravel() + margin) - begin
        which = np.repeat(np.arange(len(counts)), counts)
        nth = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
        row, edge = np.divmod(which, len(self._start))
        place = begin[which] + nth - row * angles.shape[1]
        return row, edge, order[row, place % len(receivers_m)]

    def _containing(self, points_m: Float64) -> Int64:
        """How many footprints (S,) hold each point."""
        points, _ = self._tree.query(shapely.points(points_m), predicate="within")
        return np.bincount(points, minlength=len(points_m))


def _angles(origins_m: Float64, points_m: Float64) -> Float64:
    """Directions (T, P) of points (P, 2) as seen from the origins (T, 2)."""
    delta_m = points_m - origins_m[:, None]
    return np.arctan2(delta_m[..., 1], delta_m[..., 0])


def _cross(one: Float64, other: Float64) -> Float64:
    return one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
