"""What advpipe asks of a 3D detector; SECOND is the shipped one, and users plug in their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class Range:
    """The space in the LiDAR's frame that a detector looks at, in metres."""

    x_min_m: float
    y_min_m: float
    z_min_m: float
    x_max_m: float
    y_max_m: float
    z_max_m: float

    def contains_centres(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which of the boxes (M, 7) have their centre inside in x and y: (M,)."""
        x, y = boxes[:, 0], boxes[:, 1]
        inside: npt.NDArray[np.bool_] = (
            (x >= self.x_min_m) & (x < self.x_max_m) & (y >= self.y_min_m) & (y < self.y_max_m)
        )
        return inside


@dataclass(frozen=True)
class Detections:
    """K detections in one cloud, best first.

    boxes: (K, 7) float64, columns `geometry.boxes.BOX_COLUMNS`, in the cloud's frame.
    scores: (K,) float64 in [0, 1].
    labels: (K,) int64, index into the detector's own `classes`.
    """

    boxes: npt.NDArray[np.float64]
    scores: npt.NDArray[np.float64]
    labels: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.boxes)


@runtime_checkable
class Detector(Protocol):
    """A 3D detector on LiDAR clouds."""

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes it can find, each one of `geometry.boxes.CLASSES`."""

    @property
    def range_m(self) -> Range:
        """Where it can find them."""

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        """The objects in a cloud (N,), a structured array of `bag.cloud.POINT_DTYPE`."""

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        """The training loss, a scalar that can be differentiated to the points.

        points: (N, 4) float32 x, y, z, intensity; boxes: (M, 7) float32; labels: (M,) int64,
        index into `classes`.
        """


@runtime_checkable
class VoxelDetector(Detector, Protocol):
    """A detector that reads which voxels are occupied, and can say what each occupancy is worth."""

    def occupancy_loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The loss as a function of voxel occupancy.

        Returns the scalar loss; the occupancy (V,) of the V occupied voxels, a leaf of ones that
        requires a gradient; and the voxel of each point (N,) int64, -1 for a point that the
        detector does not read (out of range).
        """
