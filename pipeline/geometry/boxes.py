"""Upright 3D boxes: their columns and classes, and the points inside them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, transform_points, wrap_angle, yaw_of

CLASSES = ("car", "truck", "cyclist", "pedestrian")
"""Class names in the order of labels; `truck` includes vans and buses, `cyclist` includes motorcycles."""

BOX_COLUMNS = ("x_m", "y_m", "z_m", "length_m", "width_m", "height_m", "yaw_rad")
"""Columns of a box array (M, 7); x, y, z is the centre, and yaw is positive from +x towards +y."""

MIN_POINTS = 5
"""An object with fewer points in the clean cloud is not used for training, attacked or evaluated."""


def no_boxes() -> Float64:
    """An empty box array (0, 7), float64."""
    return np.zeros((0, len(BOX_COLUMNS)))


@dataclass(frozen=True, slots=True)
class Boxes:
    """M labelled road users in one frame.

    geometry: (M, 7) float64, columns `BOX_COLUMNS`.
    labels: (M,) int64, index into `CLASSES`.
    ids: (M,) names, stable over the drive; "" where unknown.
    velocity_mps: (M, 3) float64, in the same frame of reference as the boxes; NaN where unknown.
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
        """Transform these boxes from frame b to frame a; boxes stay upright if the frames are tilted.

        a_SE3_b: (4, 4) homogeneous matrix.
        """
        geometry = self.geometry.copy()
        geometry[:, :3] = transform_points(a_SE3_b, geometry[:, :3])
        geometry[:, 6] = wrap_angle(geometry[:, 6] + yaw_of(a_SE3_b))
        return Boxes(geometry, self.labels, self.ids, self.velocity_mps @ a_SE3_b[:3, :3].T)


def joined_boxes(*several: Boxes) -> Boxes:
    """All boxes of one frame, in order."""
    return Boxes(
        np.concatenate([each.geometry for each in several]),
        np.concatenate([each.labels for each in several]),
        tuple(name for each in several for name in each.ids),
        np.concatenate([each.velocity_mps for each in several]),
    )


SLACK_M = 0.01
"""Tolerance for the rounding of single-precision coordinates when cells are looked up."""


def box_corners(boxes: npt.ArrayLike) -> Float64:
    """Corners (M, 8, 3) of boxes (M, 7): the bottom face anticlockwise from front left, then the top."""
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
    """For each of the boxes (M, 7), the sorted indices of the points (N, 3 or more) inside it.

    margin_m: enlarges each box on every side. A point on a face is inside.
    """
    return [np.sort(inside) for inside in _points_inside(points, boxes, margin_m)]


def count_points(points: npt.ArrayLike, boxes: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """The number (M,) of points (N, 3) in each of the boxes (M, 7)."""
    return np.array([len(indices) for indices in _points_inside(points, boxes, 0.0)], dtype=np.int64)


def _points_inside(
    points: npt.ArrayLike, boxes: npt.ArrayLike, margin_m: float
) -> Iterator[npt.NDArray[np.int64]]:
    """The indices of the points inside each box, in the order of their x."""
    boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 7)
    radii = np.hypot(boxes[:, 3], boxes[:, 4]) / 2 + margin_m * np.sqrt(2) + 1e-9
    candidates = near_circles(np.asarray(points), boxes[:, :2], radii)
    points = np.asarray(points)[candidates, :3].astype(np.float64)
    low_x = points[:, 0].min(initial=np.inf)
    per_m = (2**16 - 1) / max(points[:, 0].max(initial=-np.inf) - low_x, 1e-3)
    strips = ((points[:, 0] - low_x) * per_m).astype(np.uint16)
    order = np.argsort(strips, kind="stable")  # of 16-bit numbers: a radix sort
    strips, candidates = strips[order], candidates[order]
    xs, ys, zs = np.take(points.T, order, axis=1)
    reach = (boxes[:, :1] - low_x + radii[:, None] * (-1, 1)) * per_m
    reach = np.nan_to_num(reach, nan=-1.0).clip(-1, 2**16)
    firsts = np.searchsorted(strips, np.floor(reach[:, 0]))
    lasts = np.searchsorted(strips, np.floor(reach[:, 1]), side="right")
    sides = (boxes[:, 3:6] / 2 + margin_m).tolist()
    turns = np.stack([np.cos(boxes[:, 6]), np.sin(boxes[:, 6])], axis=1).tolist()
    spans = zip(firsts.tolist(), lasts.tolist(), strict=True)
    for (x, y, z), (half_x, half_y, half_z), (cos, sin), (first, last) in zip(
        boxes[:, :3].tolist(), sides, turns, spans, strict=True
    ):
        dx, dy = xs[first:last] - x, ys[first:last] - y
        hit = abs(dx * cos + dy * sin) <= half_x
        hit &= abs(dy * cos - dx * sin) <= half_y
        hit &= abs(zs[first:last] - z) <= half_z
        yield candidates[first:last][hit]


def near_circles(
    points: npt.NDArray[np.floating[Any]], centres: Float64, radii: Float64
) -> npt.NDArray[np.int64]:
    """Indices of the points (N, 2 or more) in a cell of the x-y grid that any of M circles touches.

    Most points of a cloud are near no box; a lookup in this grid rejects them in a few nanoseconds each.
    """
    finite = np.isfinite(centres).all(axis=1) & np.isfinite(radii)
    if not finite.any():
        return np.zeros(0, np.int64)
    radii = radii + SLACK_M
    low = (centres - radii[:, None])[finite].min(axis=0)
    span = (centres + radii[:, None])[finite].max(axis=0) - low
    cell = max(1.0, float(span.max()) / 1000)  # a small grid even if boxes are far apart
    touched = np.zeros(np.floor(span / cell).astype(np.int64) + 3, dtype=bool)
    first = np.floor((centres[finite] - radii[finite, None] - low) / cell).astype(np.int64)
    last = np.floor((centres[finite] + radii[finite, None] - low) / cell).astype(np.int64)
    for (i, j), (k, m) in zip(first.tolist(), last.tolist(), strict=True):
        touched[i + 1 : k + 2, j + 1 : m + 2] = True  # the cells at the rim stay untouched
    cells = []
    for axis in range(2):
        with np.errstate(invalid="ignore"):  # points that are not finite fall on the rim
            place = points[:, axis] - points.dtype.type(low[axis])
            place *= points.dtype.type(1 / cell)
            place += 1
            cells.append(place.astype(np.int32))
        np.clip(cells[axis], 0, touched.shape[axis] - 1, out=cells[axis])
    cells[0] *= touched.shape[1]
    return np.flatnonzero(np.take(touched.ravel(), cells[0] + cells[1]))
