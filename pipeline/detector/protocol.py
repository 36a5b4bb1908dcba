"""The interface of 3D object detectors; three families are shipped, and users can plug in their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.detector_frame import AS_RECORDED, DetectorFrame

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class Range:
    """The space in the LiDAR's frame that a detector covers, in metres."""

    x_min_m: float
    y_min_m: float
    z_min_m: float
    x_max_m: float
    y_max_m: float
    z_max_m: float

    def contains_centres(self, boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which boxes (M, 7) have their centre inside in x and y: (M,)."""
        x, y = boxes[:, 0], boxes[:, 1]
        inside: npt.NDArray[np.bool_] = (
            (x >= self.x_min_m) & (x < self.x_max_m) & (y >= self.y_min_m) & (y < self.y_max_m)
        )
        return inside


@dataclass(frozen=True, slots=True)
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
class ObjectDetector(Protocol):
    """A 3D detector on LiDAR clouds.

    Input tensors are on the CPU, whatever device it computes on, and gradients must reach them there.
    """

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that it detects, each one of `geometry.boxes.CLASSES`."""

    @property
    def range_m(self) -> Range:
        """The space that it covers."""

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        """The objects in a cloud (N,), a structured array of `messages.cloud.POINT_DTYPE`."""

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        """The training loss, a scalar that can be differentiated with respect to the points.

        points: (N, 4) float32 x, y, z, intensity; boxes: (M, 7) float32; labels: (M,) int64,
        index into `classes`.
        """


@dataclass(frozen=True)
class VoxelGrid:
    """The voxel grid of a detector.

    low_m: the lowest corner, x, y, z. size_m: of a voxel. shape: number of voxels along x, y and z.
    frame: in which the grid lies, beside the LiDAR's.
    """

    low_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    shape: tuple[int, int, int]
    frame: DetectorFrame = AS_RECORDED

    def cells(self, xyz_m: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
        """The voxel (N, 3) of each point (N, 3 or more) in the LiDAR's frame; -1 in all columns for a point
        outside the grid.

        In single precision, like the detector, so that points near a face get the same voxel.
        """
        low, size = np.array(self.low_m, np.float32), np.array(self.size_m, np.float32)
        with np.errstate(invalid="ignore", over="ignore"):
            scaled = np.floor((self.frame.xyz(np.asarray(xyz_m, np.float32)[:, :3]) - low) / size)
            inside = ((scaled >= 0) & (scaled < np.array(self.shape))).all(axis=1)
        return np.where(inside[:, None], scaled, -1).astype(np.int64)

    def keys(self, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """One number (N,) for each voxel (N, 3); -1 for a voxel outside the grid."""
        inside = ((cells >= 0) & (cells < np.array(self.shape))).all(axis=1)
        linear = (cells[:, 0] * self.shape[1] + cells[:, 1]) * self.shape[2] + cells[:, 2]
        return np.where(inside, linear, -1)

    def low_corners_m(self, cells: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """The lowest corner (N, 3), in the grid's own frame, of each cell (N, 3)."""
        corners: npt.NDArray[np.float64] = np.array(self.low_m) + cells * np.array(self.size_m)
        return corners


@dataclass(frozen=True)
class OccupancyLoss:
    """What one pass of a `VoxelDetector` computes for a cloud of N points and G probe points.

    loss: a scalar. occupancy: (V,) of the V voxels with a point or probe point, a leaf of ones and zeros that
    requires a gradient. rows: (N + G,) int64, the row in it of each point and then of each probe point, -1
    for one that the detector ignores (out of range). found: the objects that it detects in the points, if the
    same pass tells.
    """

    loss: Tensor
    occupancy: Tensor
    rows: Tensor
    found: Detections | None = None


@runtime_checkable
class VoxelDetector(ObjectDetector, Protocol):
    """A detector on voxels whose loss can be differentiated with respect to voxel occupancy."""

    @property
    def voxel_grid(self) -> VoxelGrid:
        """Its voxels."""

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> OccupancyLoss:
        """The loss as a function of voxel occupancy, optionally including empty voxels.

        probes: (G, 4) float32, probe points in empty voxels. They enter as voxels of
        occupancy 0, so that the loss is that of the points alone, while its gradient shows the effect of a
        point there. Probe points in the same voxel share its row; in an occupied voxel they are ignored.
        Where the points require a gradient, the same backward pass computes it.
        """


@dataclass(frozen=True)
class LossInput:
    """The arguments of `loss` and `occupancy_loss`, under the same names."""

    points: Tensor
    boxes: Tensor
    labels: Tensor
    probes: Tensor | None = None


@runtime_checkable
class BatchDetector(VoxelDetector, Protocol):
    """A detector that computes several clouds in one pass, with the same results up to rounding.

    Each `_batch` method returns for each cloud (N_i, 4) what the method without the suffix returns for one.
    The losses of a batch may share a graph, so they are differentiated together. An invalid input, such as
    points that are not finite, may fail the whole batch; its inputs are then computed one by one.
    """

    def detect_batch(self, clouds: Sequence[Tensor]) -> list[Detections]:
        """The objects in each of the clouds (N_i, 4) x, y, z, intensity."""

    def loss_batch(self, inputs: Sequence[LossInput]) -> list[Tensor]:
        """The loss of each input, a scalar; without probe points."""

    def occupancy_loss_batch(self, inputs: Sequence[LossInput]) -> list[OccupancyLoss]:
        """The result of each input, its occupancy a separate leaf."""
