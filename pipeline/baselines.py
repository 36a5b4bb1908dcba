"""Random changes of a cloud under a given budget: what an attack must beat to be called one.

Each function spends exactly the budget it is given, so that an attack and its baseline differ only
in where they spend it (Carlini et al. 2019, "On Evaluating Adversarial Robustness", section 3.4).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.cloud import Cloud, xyz
from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes

Float64 = npt.NDArray[np.float64]


def remove_random_points(cloud: Cloud, count: int, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Take `count` points of a cloud (N,) away, uniformly: the indices of the N - count kept, ascending.

    Points that are not finite are rays without an echo: they are no points to take.
    """
    removed = rng.choice(np.flatnonzero(np.isfinite(xyz(cloud)).all(axis=1)), size=count, replace=False)
    return np.delete(np.arange(len(cloud)), removed)


def move_random_points(cloud: Cloud, displacement_m: npt.ArrayLike, rng: np.random.Generator) -> Cloud:
    """Move each point in a uniformly random direction.

    displacement_m: how far each point moves, (N,) or one number for all. As stored in float32 no
    point moves farther, and it falls short by the rounding of its coordinates at most.
    """
    length = np.broadcast_to(np.asarray(displacement_m, dtype=np.float64), len(cloud))
    offset = _random_directions(len(cloud), rng) * length[:, None]
    return _with_xyz(cloud, move_within(xyz(cloud), offset))


def add_random_points(
    cloud: Cloud, count: int, distance_m: float, rng: np.random.Generator, boxes: Boxes | None = None
) -> Cloud:
    """Append `count` points, each uniformly in the ball of radius `distance_m` around a random point.

    The random points are those in the boxes grown by `distance_m`; all points where no boxes are
    given or none holds a point. A new point copies the other fields of the point it starts from.
    """
    if len(cloud) == 0 or count == 0:
        return cloud.copy()
    sources = np.arange(len(cloud))
    if boxes is not None and len(boxes):
        near = np.unique(np.concatenate(points_in_boxes(xyz(cloud), boxes.geometry, distance_m)))
        sources = near if len(near) else sources
    added = cloud[rng.choice(sources, size=count)]
    radius = distance_m * rng.random(count) ** (1 / 3)  # uniform over the ball's volume
    offset = _random_directions(count, rng) * radius[:, None]
    return np.concatenate([cloud, _with_xyz(added, move_within(xyz(added), offset))])


def move_within(
    start: npt.NDArray[np.float32], offset_m: npt.NDArray[np.floating]
) -> npt.NDArray[np.float32]:
    """`start + offset` (N, 3) in float32, rounded towards `start`: never farther away than the offset."""
    offset = np.asarray(offset_m, dtype=np.float64)
    end = (start + offset).astype(np.float32)
    too_far = np.abs(end.astype(np.float64) - start) > np.abs(offset)
    return np.where(too_far, np.nextafter(end, start), end)


def _random_directions(count: int, rng: np.random.Generator) -> Float64:
    """Unit vectors (count, 3), uniform over the sphere; a hair short, so that rounding cannot exceed 1."""
    vectors = rng.standard_normal((count, 3))
    length: Float64 = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / length * (1 - 1e-12)


def _with_xyz(cloud: Cloud, coordinates: npt.NDArray[np.float32]) -> Cloud:
    moved = cloud.copy()
    moved["x"], moved["y"], moved["z"] = coordinates.T
    return moved
