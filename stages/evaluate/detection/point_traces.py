"""What gives changed points away: moved ones leave their ray, and an attack on voxels puts them at a face."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference

OFF_RAY_M = 0.001
"""A moved point that is farther than this from the ray of its clean place has left it."""

AT_FACE_M = 0.0015
"""A point this near to a face of its voxel lies at it."""


@dataclass(frozen=True, slots=True)
class PointTraces:
    """Counts of points. off_ray: moved ones that left their ray. in_grid, at_face: moved and added ones that
    the detector's voxels hold, and those of them at a face; clean_in_grid, clean_at_face: of the clean cloud.
    All of the latter are 0 for a detector without voxels."""

    off_ray: int = 0
    in_grid: int = 0
    at_face: int = 0
    clean_in_grid: int = 0
    clean_at_face: int = 0

    @classmethod
    def of(cls, clean: Cloud, cloud: Cloud, change: CloudDifference, grid: VoxelGrid | None) -> PointTraces:
        """The counts in one changed cloud."""
        start = xyz(clean)[change.moved].astype(np.float64)
        offset_m = xyz(cloud)[change.moved] - start
        unit = start / np.maximum(np.linalg.norm(start, axis=1, keepdims=True), 1e-9)
        across_m = np.linalg.norm(offset_m - (offset_m * unit).sum(axis=1, keepdims=True) * unit, axis=1)
        off_ray = int((across_m > OFF_RAY_M).sum())
        if grid is None:
            return cls(off_ray)
        touched = xyz(cloud)[np.concatenate([change.moved, change.added])]
        return cls(off_ray, *_at_face(touched, grid), *_at_face(xyz(clean), grid))

    @classmethod
    def over(cls, frames: Sequence[PointTraces]) -> PointTraces:
        """The sums over several frames."""
        return cls(*map(sum, zip(*map(astuple, frames), strict=True))) if frames else cls()


def _at_face(points: npt.NDArray[np.float32], grid: VoxelGrid) -> tuple[int, int]:
    """How many points (N, 3) lie in the grid, and how many of these at a face."""
    inside = points[(grid.cells(points) >= 0).all(axis=1)].astype(np.float64)
    size_m = np.array(grid.size_m)
    past_m = np.mod(grid.frame.places(inside) - np.array(grid.low_m), size_m)
    nearest_m = np.minimum(past_m, size_m - past_m).min(axis=1, initial=np.inf)
    return len(inside), int((nearest_m <= AT_FACE_M).sum())
