"""Random baselines: random changes of a cloud under a given budget, with which attacks are compared.

Each function uses exactly the given budget, so that an attack and its baseline differ only in where they
use it (Carlini et al. 2019, "On Evaluating Adversarial Robustness", section 3.4).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]


NEAR_M = 0.5
"""A point is near an object up to this far from its box."""


def remove_random_points(
    cloud: Cloud, count: int, rng: np.random.Generator, boxes: Boxes | None = None
) -> npt.NDArray[np.int64]:
    """Remove `count` points of a cloud (N,) uniformly: returns the indices (N - count,) kept, ascending.

    With boxes, points near them are removed first, and other points only if those are too few. Points that
    are not finite (rays without an echo) are never removed.
    """
    is_finite = np.isfinite(xyz(cloud)).all(axis=1)
    near = is_finite & points_near(cloud, boxes)
    inside = random_points(np.flatnonzero(near), min(count, int(near.sum())), rng)
    others = random_points(np.flatnonzero(is_finite & ~near), count - len(inside), rng)
    return np.delete(np.arange(len(cloud)), np.concatenate([inside, others]))


def random_points(
    points: npt.NDArray[np.int64], count: int, rng: np.random.Generator
) -> npt.NDArray[np.int64]:
    """`count` of these points (K,), each at most once, drawn uniformly."""
    drawn: npt.NDArray[np.int64] = rng.choice(points, size=count, replace=False)
    return drawn


def add_random_points(
    cloud: Cloud, count: int, distance_m: float, rng: np.random.Generator, boxes: Boxes | None = None
) -> Cloud:
    """Append `count` points to a cloud (N,), each drawn uniformly from a ball around a randomly drawn point.

    The balls have the radius `distance_m`. Their centres are drawn from the points in the boxes enlarged by
    `distance_m`, or from all points if there are no boxes or none holds a point. A new point copies the other
    fields of the point at its ball's centre.
    """
    if len(cloud) == 0 or count == 0:
        return cloud.copy()
    near = points_near(cloud, boxes, distance_m)
    sources = np.flatnonzero(near) if near.any() else np.arange(len(cloud))
    added = cloud[rng.choice(sources, size=count)]
    offset = random_offsets(count, distance_m, rng)
    return np.concatenate([cloud, _with_xyz(added, move_within(xyz(added), offset))])


def points_near(cloud: Cloud, boxes: Boxes | None, margin_m: float = NEAR_M) -> npt.NDArray[np.bool_]:
    """Which points of a cloud (N,) lie in the boxes, enlarged by a margin; all points if boxes is None."""
    if boxes is None:
        return np.ones(len(cloud), bool)
    return points_near_boxes(cloud, boxes.geometry, margin_m)


def points_near_boxes(cloud: Cloud, boxes: Float64, margin_m: float = NEAR_M) -> npt.NDArray[np.bool_]:
    """Which points of a cloud (N,) lie in the boxes (M, 7), enlarged by a margin."""
    near = np.zeros(len(cloud), bool)
    for inside in points_in_boxes(xyz(cloud), boxes, margin_m):
        near[inside] = True
    return near


def move_within(
    start: npt.NDArray[np.float32], offset_m: npt.NDArray[np.floating]
) -> npt.NDArray[np.float32]:
    """`start + offset` (N, 3) as float32, rounded towards `start`: no point moves beyond its offset."""
    offset = np.asarray(offset_m, dtype=np.float64)
    end = (start + offset).astype(np.float32)
    too_far = np.abs(end.astype(np.float64) - start) > np.abs(offset)
    nearer: npt.NDArray[np.float32] = np.nextafter(end, start, out=end, where=too_far)
    return nearer


def random_offsets(count: int, radius_m: float, rng: np.random.Generator) -> Float64:
    """Vectors (count, 3), uniform over the ball of radius `radius_m`; rounding never makes one longer."""
    length = radius_m * rng.random((count, 1)) ** (1 / 3)  # uniform over the ball's volume
    return random_directions(count, rng) * length


def random_directions(count: int, rng: np.random.Generator) -> Float64:
    """Unit vectors (count, 3), uniform over the sphere; shortened by 1e-12, so that no length exceeds 1."""
    vectors = rng.standard_normal((count, 3))
    length: Float64 = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / length * (1 - 1e-12)


def _with_xyz(cloud: Cloud, coordinates: npt.NDArray[np.float32]) -> Cloud:
    moved = cloud.copy()
    moved["x"], moved["y"], moved["z"] = coordinates.T
    return moved
