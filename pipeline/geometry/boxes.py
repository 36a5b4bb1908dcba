"""Upright 3D boxes: the columns, the classes, and which points lie inside."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, transform_points, wrap_angle, yaw_of

CLASSES = ("car", "truck", "cyclist", "pedestrian")
"""Class names in the order of their label; `truck` holds vans and buses, `cyclist` motorcycles."""

BOX_COLUMNS = ("x_m", "y_m", "z_m", "length_m", "width_m", "height_m", "yaw_rad")
"""Columns of a box array (M, 7); x, y, z is the centre, yaw is counted from +x to +y."""

MIN_POINTS = 5
"""An object with fewer points in the clean cloud is not learned from, attacked nor evaluated."""


def no_boxes() -> Float64:
    return np.zeros((0, len(BOX_COLUMNS)))


@dataclass(frozen=True)
class Boxes:
    """M labelled road users in one frame.

    geometry: (M, 7) float64, columns `BOX_COLUMNS`.
    labels: (M,) int64, index into `CLASSES`.
    ids: (M,) names, stable over the drive; "" where unknown.
    velocity_mps: (M, 3) float64 in the boxes' own frame of reference; NaN where unknown.
    """

    geometry: Float64 = field(default_factory=no_boxes)
    labels: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    ids: tuple[str, ...] = ()
    velocity_mps: Float64 = field(default_factory=lambda: np.zeros((0, 3)))

    def __len__(self) -> int:
        return len(self.geometry)

    def __getitem__(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> Boxes:
        """The chosen boxes, by mask (M,) or indices (K,)."""
        indices = np.arange(len(self))[chosen]
        return Boxes(
            self.geometry[indices],
            self.labels[indices],
            tuple(self.ids[i] for i in indices),
            self.velocity_mps[indices],
        )

    def transformed(self, a_SE3_b: Float64) -> Boxes:
        """These boxes of frame b in frame a; roll and pitch between the frames tilt no box."""
        geometry = self.geometry.copy()
        geometry[:, :3] = transform_points(a_SE3_b, geometry[:, :3])
        geometry[:, 6] = wrap_angle(geometry[:, 6] + yaw_of(a_SE3_b))
        return Boxes(geometry, self.labels, self.ids, self.velocity_mps @ a_SE3_b[:3, :3].T)


def box_corners(boxes: npt.ArrayLike) -> Float64:
    """Corners (M, 8, 3) of boxes (M, 7): bottom face anticlockwise from front left, then top."""
    boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 7)
    signs = np.array(
        [[x, y, z] for z in (-0.5, 0.5) for x, y in ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))]
    )
    local = signs[None] * boxes[:, None, 3:6]
    c, s = np.cos(boxes[:, 6, None]), np.sin(boxes[:, 6, None])
    x, y = local[..., 0] * c - local[..., 1] * s, local[..., 0] * s + local[..., 1] * c
    return np.stack([x, y, local[..., 2]], axis=-1) + boxes[:, None, :3]


def points_in_boxes(
    points: npt.ArrayLike, boxes: npt.ArrayLike, margin_m: float = 0.0
) -> list[npt.NDArray[np.int64]]:
    """For each of the boxes (M, 7), the indices of the points (N, 3) inside it, grown by a margin.

    A point on a face is inside.
    """
    points = np.asarray(points, dtype=np.float64)[:, :3]
    boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 7)
    order = np.argsort(points[:, 0], kind="stable")
    sorted_x = points[order, 0]
    inside = []
    for x, y, z, length, width, height, yaw in boxes:
        radius = np.hypot(length, width) / 2 + margin_m * np.sqrt(2) + 1e-9
        first, last = np.searchsorted(sorted_x, [x - radius, x + radius])
        near = order[first:last]
        dx, dy = points[near, 0] - x, points[near, 1] - y
        along, across = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
        hit = (
            (np.abs(along) <= length / 2 + margin_m)
            & (np.abs(across) <= width / 2 + margin_m)
            & (np.abs(points[near, 2] - z) <= height / 2 + margin_m)
        )
        inside.append(np.sort(near[hit]))
    return inside


def count_points(points: npt.ArrayLike, boxes: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """How many of the points (N, 3) each of the boxes (M, 7) holds: (M,)."""
    return np.array([len(indices) for indices in points_in_boxes(points, boxes)], dtype=np.int64)
