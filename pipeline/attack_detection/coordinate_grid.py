"""The grid to which a LiDAR or its format rounds coordinates, learnt from a cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.cloud import Cloud, xyz

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

STEPS_M = (0.01, *(2.0**-power for power in range(7, 13)), 0.005, 0.004, 0.002, 0.001)
"""The steps that are tried, coarse ones first: decimal ones, as text files have them, and powers of two."""

CONSTRUCTED_M = (0.1, 0.0625, 0.05, 0.03125, 0.025, 0.015625, 0.0125)
"""No sensor rounds as coarsely: a cloud on such a grid was made by hand."""

MIN_POINTS = 20
"""Of fewer points, some lie on a coarse grid by chance."""

ON_GRID = 0.98
"""The share of coordinates that lie on the grid: an attack may have moved others."""


@dataclass(frozen=True)
class CoordinateGrid:
    """Coordinates are the multiples of `step_m`, as float32 stores them."""

    step_m: float

    @classmethod
    def learnt(cls, cloud: Cloud) -> CoordinateGrid | None:
        """From a cloud (N,), clean or with some points changed; None if coordinates are not rounded."""
        points = xyz(cloud)
        finite = np.isfinite(points[:, 0]) & np.isfinite(points[:, 1]) & np.isfinite(points[:, 2])
        points = points if finite.all() else points[finite]
        if len(points) < MIN_POINTS:
            return None
        few = points[:: max(1, len(points) // 500)]
        for step_m in sorted((*CONSTRUCTED_M, *STEPS_M), reverse=True):
            grid = cls(step_m)
            if all((grid.offset_m(each) == 0).mean() >= ON_GRID for each in (few, points)):
                return None if step_m in CONSTRUCTED_M else grid
        return None

    def offset_m(self, points: npt.NDArray[np.floating]) -> Float64:
        """How far coordinates (N, 3) lie from the grid, 0 for those that are its values in float32."""
        nearest = self._stored(np.rint(points.astype(np.float64) / self.step_m))
        off_m: Float64 = np.abs(points.astype(np.float64) - nearest)
        return off_m

    def towards(self, start: Float32, moved: Float32) -> Float32:
        """Moved points (N, 3), on the grid: rounded towards where they started (N, 3), which lies on it, so
        that none moves farther."""
        begin = np.rint(start.astype(np.float64) / self.step_m)
        steps = moved.astype(np.float64) / self.step_m - begin
        rounded = self._stored(begin + np.trunc(steps + np.copysign(1e-6, steps)))
        is_moved = (moved != start) & np.isfinite(moved)
        return np.where(is_moved, rounded, moved)

    def _stored(self, steps: Float64) -> Float32:
        return (steps * self.step_m).astype(np.float32)


def on_grid_of(cloud: Cloud, start: Float32, moved: Float32) -> Float32:
    """Points (N, 4) that moved from some of a cloud's own (N, 4), on the grid of that cloud if it has one."""
    grid = CoordinateGrid.learnt(cloud)
    if grid is None:
        return moved
    rounded = moved.copy()
    rounded[:, :3] = grid.towards(start[:, :3], moved[:, :3])
    return rounded
