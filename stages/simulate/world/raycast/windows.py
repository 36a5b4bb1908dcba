"""Which rays may hit which boxes, by angular windows, so that few rays are cast at each road user."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.index_ranges import index_ranges
from advpipe.pipeline.geometry.transforms import Float64

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

BINS = 65535
"""Number of bearing bins in a full circle."""

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)


class BearingWindow(NamedTuple):
    """Bearings [first, last] in bins, which may lie beyond [0, `BINS`]; slopes dz/dxy [low, high]."""

    first: Float64
    last: Float64
    low: Float64
    high: Float64


def _bearing(x: Any, y: Any) -> Any:
    """Increases with the angle of (x, y) as atan2 does, from -2 to 2, at the cost of one division."""
    return np.copysign(1 - x / np.maximum(np.abs(x) + np.abs(y), np.float32(1e-9)), y)


def _bin_of(angle_rad: Float64) -> Float64:
    """The fractional bin of an angle; each full turn adds `BINS`."""
    turns = np.floor((angle_rad + np.pi) / (2 * np.pi))
    bins: Float64 = (_bearing(np.cos(angle_rad), np.sin(angle_rad)) + 2 + 4 * turns) * BINS / 4
    return bins


class SortedRays:
    """Rays with nearly the same origin, sorted by their bearing.

    origins_m: (3, R), or (3, 1) for all. directions: (3, R). place: the middle and the spread of the origins.
    """

    def __init__(self, origins_m: Float32, directions: Float32) -> None:
        low, high = origins_m.min(axis=1), origins_m.max(axis=1)
        self._origin_m = (low.astype(np.float64) + high) / 2
        self._spread_m = float(np.linalg.norm(high.astype(np.float64) - low)) / 2
        self.place = *self._origin_m.tolist(), self._spread_m
        x, y, z = directions
        bins = ((_bearing(x, y) + 2) * np.float32(BINS / 4)).astype(np.uint16)
        self._order = np.argsort(bins, kind="stable")
        self._bins = bins[self._order]
        slopes = z / np.maximum(np.sqrt(x * x + y * y), np.float32(1e-9))
        self._slopes = slopes[self._order]

    def pairs(self, map_SE3_box: Float64, half_m: Float64) -> tuple[Int64, Int64]:
        """Ray and box indices (N,) of all rays that may hit a box, a superset of those that do.

        map_SE3_box: (B, 4, 4), the frame at each box's centre. half_m: (B, 3), half of each side.
        """
        ahead = self.ahead(map_SE3_box[:, :3, 3], np.sqrt((half_m * half_m).sum(axis=1)))
        rays, boxes = self.pairs_in(self.window(map_SE3_box[ahead], half_m[ahead]))
        return rays, ahead[boxes]

    def ahead(self, centres_m: Float64, radius_m: Float64) -> Int64:
        """Indices of the spheres (B, 3) of radius (B,) that the sector of the rays may touch, from above.

        A sensor of a narrow view spares the windows of most boxes.
        """
        x, y = (centres_m - self._origin_m)[:, :2].T
        away_m, reach_m = np.hypot(x, y), radius_m + self._spread_m
        within_rad = np.arcsin(np.minimum(reach_m / np.maximum(away_m, 1e-9), 1))
        half_rad = np.where(away_m > reach_m, within_rad, np.pi)
        bearing = np.arctan2(y, x)
        first, last = _bin_of(bearing - half_rad) - 2, _bin_of(bearing + half_rad) + 2
        low, high = float(self._bins[0]), float(self._bins[-1])
        touched = [(first <= high + turn) & (last >= low + turn) for turn in (-BINS, 0, BINS)]
        return np.flatnonzero(np.logical_or.reduce(touched))

    def pairs_in(self, window: BearingWindow) -> tuple[Int64, Int64]:
        """See `pairs`, of boxes in these windows (B,)."""
        # A window across the end of the circle is split in two; most windows have an empty second half.
        shift = np.where(window.first < 0, BINS, np.where(window.last > BINS, -BINS, 2 * BINS))
        first = np.concatenate([window.first, window.first + shift]).clip(0, BINS + 1)
        last = np.concatenate([window.last, window.last + shift]).clip(-1, BINS)
        starts = np.searchsorted(self._bins, np.ceil(first).astype(np.int64), side="left")
        ends = np.searchsorted(self._bins, np.floor(last).astype(np.int64), side="right")
        counts = np.maximum(ends - starts, 0)
        place = index_ranges(starts, counts)
        slopes = self._slopes[place]
        low, high = (np.tile(side, 2).astype(np.float32) for side in (window.low, window.high))
        inside = (slopes >= np.repeat(low, counts)) & (slopes <= np.repeat(high, counts))
        boxes = np.repeat(np.tile(np.arange(len(window.first)), 2), counts)
        return self._order[place[inside]], boxes[inside]

    def window(self, map_SE3_box: Float64, half_m: Float64) -> BearingWindow:
        """The window of each box, for rays that start within `spread_m` of the origin."""
        rotation, centre = map_SE3_box[:, :3, :3], map_SE3_box[:, :3, 3] - self._origin_m
        corners = centre[:, None] + np.einsum("bij,bcj->bci", rotation, _CORNERS * half_m[:, None])
        beyond = np.maximum(np.abs(np.einsum("bji,bj->bi", rotation, centre))[:, :2] - half_m[:, :2], 0)
        # Tilted boxes reach a little beyond their floor plan.
        lean_m = np.abs(rotation[:, :2, 2]).sum(axis=1) * half_m.sum(axis=1)
        nearest_m = np.linalg.norm(beyond, axis=1) - self._spread_m - lean_m
        around = nearest_m < 0.1
        nearest_m = np.maximum(nearest_m, 0.1)
        farthest_m = np.linalg.norm(corners[..., :2], axis=-1).max(axis=1) + self._spread_m
        bearing = np.arctan2(centre[:, 1], centre[:, 0])
        turn = np.arctan2(corners[..., 1], corners[..., 0]) - bearing[:, None]
        turn = (turn + np.pi) % (2 * np.pi) - np.pi
        margin = np.arcsin(np.minimum(self._spread_m / (nearest_m + self._spread_m), 1.0))
        first = _bin_of(bearing + turn.min(axis=1) - margin) - 2
        last = _bin_of(bearing + turn.max(axis=1) + margin) + 2
        floor_m = corners[..., 2].min(axis=1) - self._spread_m
        roof_m = corners[..., 2].max(axis=1) + self._spread_m
        slack = 1e-4
        low = np.minimum(floor_m / nearest_m, floor_m / farthest_m) - slack
        high = np.maximum(roof_m / nearest_m, roof_m / farthest_m) + slack
        return BearingWindow(
            np.where(around, 0.0, first),
            np.where(around, float(BINS), last),
            np.where(around, -np.inf, low),
            np.where(around, np.inf, high),
        )
