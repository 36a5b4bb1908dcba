"""Intersection over union (IoU) of rotated upright boxes in bird's-eye view and 3D, vectorised over pairs."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64

_SIGNS = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
_CHUNK = 20_000


def iou_bev(a: npt.ArrayLike, b: npt.ArrayLike) -> Float64:
    """Bird's-eye IoU (M, K) float64 of boxes a (M, 7) and b (K, 7), columns `geometry.boxes.BOX_COLUMNS`."""
    return _iou(a, b, heights=False)


def iou_3d(a: npt.ArrayLike, b: npt.ArrayLike) -> Float64:
    """Volume IoU (M, K), float64, of boxes a (M, 7) and b (K, 7), columns `geometry.boxes.BOX_COLUMNS`."""
    return _iou(a, b, heights=True)


def _iou(a: npt.ArrayLike, b: npt.ArrayLike, heights: bool) -> Float64:
    a = np.asarray(a, dtype=np.float64).reshape(-1, 7)
    b = np.asarray(b, dtype=np.float64).reshape(-1, 7)
    iou = np.zeros((len(a), len(b)))
    i, j = _near_pairs(a, b)
    common = np.concatenate(
        [np.zeros(0)]
        + [intersection_area(a[i[s : s + _CHUNK]], b[j[s : s + _CHUNK]]) for s in range(0, len(i), _CHUNK)]
    )
    size_a, size_b = a[:, 3] * a[:, 4], b[:, 3] * b[:, 4]
    if heights:
        top = np.minimum(a[i, 2] + a[i, 5] / 2, b[j, 2] + b[j, 5] / 2)
        bottom = np.maximum(a[i, 2] - a[i, 5] / 2, b[j, 2] - b[j, 5] / 2)
        common = common * np.maximum(top - bottom, 0)
        size_a, size_b = size_a * a[:, 5], size_b * b[:, 5]
    union = size_a[i] + size_b[j] - common
    iou[i, j] = np.divide(common, union, out=np.zeros_like(common), where=union > 0)
    return iou


def _near_pairs(a: Float64, b: Float64) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Indices of the pairs whose circumscribed circles overlap; other boxes cannot overlap."""
    reach = np.hypot(a[:, 3], a[:, 4])[:, None] / 2 + np.hypot(b[:, 3], b[:, 4])[None] / 2
    dx, dy = a[:, None, 0] - b[None, :, 0], a[:, None, 1] - b[None, :, 1]
    i, j = np.nonzero(dx * dx + dy * dy <= reach * reach)
    return i.astype(np.int64), j.astype(np.int64)


def intersection_area(a: Float64, b: Float64) -> Float64:
    """Bird's-eye intersection area (P,) in m² of box a[p] with box b[p], for boxes (P, 7) each.

    The intersection of two rectangles is the convex hull of the corners of each rectangle that lie inside the
    other and of the crossings of their edges: at most 24 candidates, sorted around their centre.
    """
    # Compute relative to box a's centre, so that large coordinates do not reduce precision.
    corners_a = _corners(np.zeros((len(a), 2)), a)
    corners_b = _corners(b[:, :2] - a[:, :2], b)
    edges_a = np.roll(corners_a, -1, axis=1) - corners_a
    edges_b = np.roll(corners_b, -1, axis=1) - corners_b
    # Crossing of each edge p + t u of a with each edge q + s v of b.
    u, v = edges_a[:, :, None], edges_b[:, None]
    gap = corners_b[:, None] - corners_a[:, :, None]
    denominator = _cross(u, v)
    parallel = np.abs(denominator) < 1e-12
    denominator = np.where(parallel, 1.0, denominator)
    t, s = _cross(gap, v) / denominator, _cross(gap, u) / denominator
    crossing = ~parallel & (t >= 0) & (t <= 1) & (s >= 0) & (s <= 1)
    crossings = corners_a[:, :, None] + t[..., None] * u
    candidates = np.concatenate([corners_a, corners_b, crossings.reshape(len(a), 16, 2)], axis=1)
    valid = np.concatenate(
        [
            _inside(corners_a, b[:, :2] - a[:, :2], b),
            _inside(corners_b, np.zeros((len(a), 2)), a),
            crossing.reshape(len(a), 16),
        ],
        axis=1,
    )
    count = valid.sum(1)
    centre = np.where(valid[..., None], candidates, 0).sum(1) / np.maximum(count, 1)[:, None]
    around = candidates - centre[:, None]
    angle = np.where(valid, np.arctan2(around[..., 1], around[..., 0]), np.inf)
    order = np.argsort(angle, axis=1, kind="stable")
    # Invalid candidates are replaced by the first vertex, which adds no area.
    order = np.where(np.arange(order.shape[1]) < count[:, None], order, order[:, :1])
    polygon = np.take_along_axis(around, order[..., None], axis=1)
    area = 0.5 * np.abs(_cross(polygon, np.roll(polygon, -1, axis=1)).sum(1))
    return np.where(count >= 3, area, 0.0)


def _cross(a: Float64, b: Float64) -> Float64:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _corners(centres: Float64, boxes: Float64) -> Float64:
    """Corners (P, 4, 2) of boxes (P, 7) placed at `centres` (P, 2), anticlockwise."""
    local = _SIGNS[None] * boxes[:, None, 3:5]
    c, s = np.cos(boxes[:, 6, None]), np.sin(boxes[:, 6, None])
    x, y = local[..., 0] * c - local[..., 1] * s, local[..., 0] * s + local[..., 1] * c
    return np.stack([x, y], axis=-1) + centres[:, None]


def _inside(points: Float64, centres: Float64, boxes: Float64) -> npt.NDArray[np.bool_]:
    """Which points (P, 4, 2) lie inside or on the edge of their box (P, 7) placed at `centres` (P, 2)."""
    d = points - centres[:, None]
    c, s = np.cos(boxes[:, 6, None]), np.sin(boxes[:, 6, None])
    along, across = d[..., 0] * c + d[..., 1] * s, d[..., 1] * c - d[..., 0] * s
    return np.asarray(
        (np.abs(along) <= boxes[:, 3, None] / 2 + 1e-9) & (np.abs(across) <= boxes[:, 4, None] / 2 + 1e-9)
    )


def iou_2d(a: Float64, b: Float64) -> Float64:
    """IoU (K, M) of boxes a (K, 4) and b (M, 4) in an image: left, top, right, bottom; 0 without area."""
    shared, area_a, area_b = shared_areas(a, b)
    union = area_a[:, None] + area_b - shared
    return np.divide(shared, union, out=np.zeros(shared.shape), where=union > 0)


def shared_areas(a: Float64, b: Float64) -> tuple[Float64, Float64, Float64]:
    """The common areas (K, M) of boxes in an image, a (K, 4) and b (M, 4), and the areas (K,) and (M,)."""
    low, high = np.maximum(a[:, None, :2], b[:, :2]), np.minimum(a[:, None, 2:], b[:, 2:])
    area_a, area_b = (np.prod(each[:, 2:] - each[:, :2], axis=1) for each in (a, b))
    return np.prod(np.maximum(high - low, 0), axis=2), area_a, area_b
