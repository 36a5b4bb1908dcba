"""The receiver's road map, as navigation systems have it: is a claimed position on a road, in which
direction?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.geometry.transforms import Float64, wrap_angle

NEAR_M = 2.0
"""Lanes whose edge is within this distance count for the direction of travel."""


class RoadMap:
    """Lanes that vehicles use.

    segments_m: (L, 2, 2) segments of the centre lines in the direction of travel. widths_m: (L,).
    """

    def __init__(self, segments_m: Float64, widths_m: Float64) -> None:
        self.segments_m = segments_m
        self._lines = shapely.linestrings(segments_m) if len(segments_m) else np.array([], object)
        self._tree = shapely.STRtree(self._lines)
        along = segments_m[:, 1] - segments_m[:, 0]
        self._yaw_rad = np.arctan2(along[:, 1], along[:, 0])
        self._half_m = widths_m / 2

    @property
    def widths_m(self) -> Float64:
        """Of the lanes of the segments (L,)."""
        return self._half_m * 2

    def middle_distance_m(self, place_m: tuple[float, float]) -> float:
        """How far a place is from the centre line of any lane; infinite without any."""
        if len(self._lines) == 0 or not np.isfinite(place_m).all():
            return np.inf
        point = shapely.points(*place_m)
        return float(shapely.distance(point, self._lines[self._tree.nearest(point)]))

    def measure(self, places: Sequence[tuple[float, float, float]]) -> tuple[Float64, Float64]:
        """How far (P,) poses x, y, yaw are from any lane [m], and turned from the nearby lanes [rad].

        Zero on a lane. NaN where a position is not finite, without any lane, and for the direction where no
        lane is nearby.
        """
        at = np.array(places, np.float64).reshape(-1, 3)
        off_m, wrong_rad = np.full(len(at), np.nan), np.full(len(at), np.nan)
        (finite,) = np.nonzero(np.isfinite(at[:, :2]).all(axis=1))
        if len(self._lines) == 0 or len(finite) == 0:
            return off_m, wrong_rad
        points = shapely.points(at[finite, :2])
        # A wider lane a little farther off may be nearer with its edge.
        reach = float(self._half_m.max()) + NEAR_M
        nearest = self._tree.query_nearest(points, all_matches=False, return_distance=True)
        (asked, found), distance_m = nearest
        off_m[finite[asked]] = distance_m - self._half_m[found]
        asked, found = self._tree.query(points, predicate="dwithin", distance=reach)
        beyond_m = shapely.distance(points[asked], self._lines[found]) - self._half_m[found]
        np.fmin.at(off_m, finite[asked], beyond_m)
        near = beyond_m <= NEAR_M
        turned = np.abs(wrap_angle(at[finite[asked], 2] - self._yaw_rad[found]))
        np.fmin.at(wrong_rad, finite[asked[near]], turned[near])
        return np.maximum(off_m, 0.0), wrong_rad


NO_ROADS = RoadMap(np.zeros((0, 2, 2)), np.zeros(0))
"""An empty map: both checks that need roads are off."""


def lanes(found: Iterable[tuple[npt.ArrayLike, float]]) -> RoadMap:
    """A road map of lanes: each one's centre line (K, 2 or 3) in the direction of travel, and width, in
    metres."""
    pieces, widths = [np.zeros((0, 2, 2))], []
    for middle_m, width_m in found:
        places_m = np.asarray(middle_m, np.float64)[:, :2]
        steps = np.stack([places_m[:-1], places_m[1:]], axis=1)
        pieces.append(steps[np.any(steps[:, 0] != steps[:, 1], axis=1)])
        widths += [width_m] * len(pieces[-1])
    return RoadMap(np.concatenate(pieces), np.array(widths))
