"""The voxel-face check: real points do not prefer the faces of a detector's voxels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import CheckNotApplicableError, DefenderKnowledge, Suspicion
from advpipe.pipeline.detector.protocol import Detections, VoxelGrid
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]

AT_FACE_M = 0.0015
"""A point this near to a face of its voxel lies at it."""

TILE_M = 5.0
"""The edge of the squares of ground in which points at faces are counted."""

MIN_TILE_POINTS = 50


class VoxelFaceCheck:
    """Counts the points within 1.5 mm of a face of a voxel of the defender's own detector, on squares of
    ground of 5 m.

    The score is the largest excess over the share of the clean clouds, in standard deviations of a binomial
    count. Points at a face are taken for changed; of the clean ones, some are there by chance.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        if knowledge.grid is None:
            raise CheckNotApplicableError("the detector has no voxels")
        self._grid = knowledge.grid
        distances_m = np.concatenate([face_distance_m(xyz(each), self._grid) for each in knowledge.clean])
        inside = np.isfinite(distances_m)
        self._share = float((distances_m[inside] <= AT_FACE_M).mean()) if inside.any() else 0.0

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        points = xyz(cloud)
        distance_m = face_distance_m(points, self._grid)
        inside = np.flatnonzero(np.isfinite(distance_m))
        at_face = distance_m <= AT_FACE_M
        east, north = np.floor(points[inside, :2] / TILE_M).astype(np.int64).T
        _, number = np.unique((east << 32) + north, return_inverse=True)
        total = np.bincount(number).astype(np.float64)
        found = np.bincount(number, at_face[inside], len(total))
        enough = total >= MIN_TILE_POINTS
        spread = np.sqrt(total[enough] * max(self._share * (1 - self._share), 1e-6))
        excess = (found[enough] - total[enough] * self._share) / spread
        return Suspicion(float(excess.max(initial=0.0)), points=at_face)


def face_distance_m(points: npt.NDArray[np.float32], grid: VoxelGrid) -> Float64:
    """The distance of points (N, 3) to the nearest face of their voxel; infinite outside of the grid."""
    distance_m = np.full(len(points), np.inf)
    inside = np.flatnonzero((grid.cells(points) >= 0).all(axis=1))
    size_m = np.array(grid.size_m)
    past_m = np.mod(grid.frame.places(points[inside].astype(np.float64)) - np.array(grid.low_m), size_m)
    distance_m[inside] = np.minimum(past_m, size_m - past_m).min(axis=1, initial=np.inf)
    return distance_m
