"""Which points may lie in the shadow of which boxes, so that few shadow rays are cast at each road user."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.long_rows import turned

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

BINS = 65535


class SunBeams:
    """The lines from points (3, N) to the sun, in the direction (3,), sorted by their place across it."""

    def __init__(self, points_m: Float32, sun: Float32) -> None:
        towards = np.asarray(sun, np.float64)
        across = np.cross(towards, [0.0, 0.0, 1.0] if abs(towards[2]) < 0.9 else [1.0, 0.0, 0.0])
        across /= np.linalg.norm(across)
        self._axes = np.stack([across, np.cross(towards, across), towards])
        # Near one of the points, so that single precision suffices.
        self._origin_m = points_m[:, 0].astype(np.float64) if points_m.size else np.zeros(3)
        places = turned(self._axes, points_m - self._origin_m.astype(np.float32)[:, None])
        first = places[0]
        self._low_m = float(first.min(initial=0.0))
        self._per_m = BINS / max(float(first.max(initial=0.0)) - self._low_m, 1e-3)
        bins = ((first - np.float32(self._low_m)) * np.float32(self._per_m)).astype(np.uint16)
        self._order = np.argsort(bins, kind="stable")
        self._bins = bins[self._order]
        self._second, self._third = places[1][self._order], places[2][self._order]

    def pairs(self, map_SE3_box: Float64, half_m: Float64) -> tuple[Int64, Int64]:
        """Point and box indices (K,) of all points that a box may shade, a superset of those that it does.

        map_SE3_box: (B, 4, 4), the frame at each box's centre. half_m: (B, 3), half of each side.
        """
        centre = (map_SE3_box[:, :3, 3] - self._origin_m) @ self._axes.T
        half = np.einsum("bij,bj->bi", np.abs(self._axes @ map_SE3_box[:, :3, :3]), half_m) + 0.01
        first = ((centre[:, 0] - half[:, 0] - self._low_m) * self._per_m).clip(0, BINS + 1)
        last = ((centre[:, 0] + half[:, 0] - self._low_m) * self._per_m).clip(-1, BINS)
        starts = np.searchsorted(self._bins, np.floor(first).astype(np.int64), side="left")
        ends = np.searchsorted(self._bins, np.ceil(last).astype(np.int64), side="right")
        counts = np.maximum(ends - starts, 0)
        place = np.arange(counts.sum()) + np.repeat(starts - (np.cumsum(counts) - counts), counts)
        second, third = self._second[place], self._third[place]
        low, high, top = (
            np.repeat(edge.astype(np.float32), counts)
            for edge in (centre[:, 1] - half[:, 1], centre[:, 1] + half[:, 1], centre[:, 2] + half[:, 2])
        )
        inside = (second >= low) & (second <= high) & (third <= top)
        boxes = np.repeat(np.arange(len(half_m)), counts)
        return self._order[place[inside]], boxes[inside]
