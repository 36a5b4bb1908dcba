"""The frame in which a detector expects clouds, beside the LiDAR's own: another height, and level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import se3, transform_points

if TYPE_CHECKING:
    from torch import Tensor

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Row = tuple[float, float, float]

NO_ROTATION: tuple[Row, Row, Row] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class DetectorFrame:
    """The transform `detector_SE3_lidar`: a small rotation that levels the cloud, then a vertical shift.

    rotation: the rows of the matrix. shift_m: along the detector's z.
    """

    rotation: tuple[Row, Row, Row] = NO_ROTATION
    shift_m: float = 0.0

    @classmethod
    def of(cls, rotation: Float64, shift_m: float) -> DetectorFrame:
        """From a rotation matrix (3, 3)."""
        first, second, third = (tuple(row) for row in rotation.tolist())
        return cls((first, second, third), float(shift_m))

    @property
    def is_level(self) -> bool:
        """Whether it only shifts."""
        return self.rotation == NO_ROTATION

    @property
    def detector_SE3_lidar(self) -> Float64:
        """The transform as a matrix (4, 4)."""
        return se3(np.array(self.rotation), np.array([0.0, 0.0, self.shift_m]))

    def columns(self, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
        """Coordinates in the LiDAR's frame, brought to the detector's: arrays or tensors, in their precision.

        Column by column, so that numpy and torch round alike, and a point has one voxel in both.
        """
        if not self.is_level:
            x, y, z = (a * x + b * y + c * z for a, b, c in self.rotation)
        return x, y, (z + self.shift_m if self.shift_m else z)

    def points(self, points: Tensor) -> Tensor:
        """Points (N, 4 or more), brought to the detector's frame; differentiable."""
        import torch

        if self == AS_RECORDED:
            return points
        moved = self.columns(points[:, 0], points[:, 1], points[:, 2])
        return torch.cat([torch.stack(moved, dim=1), points[:, 3:]], dim=1)

    def xyz(self, xyz_m: Float32) -> Float32:
        """Points (N, 3) float32, brought to the detector's frame."""
        return xyz_m if self == AS_RECORDED else np.stack(self.columns(*xyz_m.T), axis=1)

    def places(self, places_m: Float64) -> Float64:
        """Points (N, 3) float64, brought to the detector's frame."""
        if self == AS_RECORDED:
            return places_m
        return transform_points(self.detector_SE3_lidar, places_m)

    def directions(self, vectors: Float64) -> Float64:
        """Vectors (N, 3), turned to the detector's frame."""
        return vectors if self.is_level else vectors @ np.array(self.rotation).T

    def directions_back(self, vectors: Float64) -> Float64:
        """Vectors (N, 3) of the detector's frame, turned to the LiDAR's."""
        return vectors if self.is_level else vectors @ np.array(self.rotation)

    def boxes(self, boxes: Float64) -> Float64:
        """Boxes (M, 7), brought to the detector's frame; they stay upright."""
        if self == AS_RECORDED:
            return boxes
        return _moved(boxes, self.places(boxes[:, :3]), np.array(self.rotation))

    def boxes_back(self, boxes: Float64) -> Float64:
        """Boxes (M, 7) of the detector's frame, brought to the LiDAR's; they stay upright."""
        if self == AS_RECORDED:
            return boxes
        centres = self.directions_back(boxes[:, :3] - (0.0, 0.0, self.shift_m))
        return _moved(boxes, centres, np.array(self.rotation).T)


AS_RECORDED = DetectorFrame()
"""The frame of a detector that sees clouds as they are."""


def _moved(boxes: Float64, centres: Float64, rotation: Float64) -> Float64:
    """Boxes (M, 7) at other centres (M, 3), with the headings that a rotation (3, 3) gives them."""
    heading = np.stack([np.cos(boxes[:, 6]), np.sin(boxes[:, 6])], axis=1) @ rotation[:2, :2].T
    turned = boxes[:, 6] + _turn(heading, boxes[:, 6])
    return np.column_stack([centres, boxes[:, 3:6], turned])


def _turn(heading: Float64, yaw_rad: Float64) -> Float64:
    """The angle (M,) from a yaw (M,) to a heading (M, 2): exactly 0 for the same."""
    along = heading[:, 0] * np.cos(yaw_rad) + heading[:, 1] * np.sin(yaw_rad)
    across = heading[:, 1] * np.cos(yaw_rad) - heading[:, 0] * np.sin(yaw_rad)
    return np.arctan2(across, along)
