"""The candidate places of `attach`: within reach of the clean cloud's points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from advpipe.pipeline.baselines import move_within, random_offsets
from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.stages.attack.lidar.constraints import Rules, along_rays
from advpipe.stages.attack.lidar.goal import owners

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

ROUNDING_FACTOR = 1 - 1e-9
"""Displacements are scaled by this, so that rounding takes none beyond its bound."""

_MAX_DRAWS = 50


@dataclass(frozen=True)
class Places:
    """C candidate places for added points.

    points: (C, 4) float32 x, y, z, and the intensity of the clean point that each starts from.
    source: (C,) the index of that point. distance_m: (C,) float64 from it, as stored. owner: (C,) the box
    that each place belongs to, -1 for none.
    """

    points: Float32
    source: Int64
    distance_m: Float64
    owner: Int64

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, chosen: npt.NDArray[np.generic]) -> Places:
        return Places(self.points[chosen], self.source[chosen], self.distance_m[chosen], self.owner[chosen])


def voxel_places(
    clean: Float32,
    boxes: Float64,
    grid: VoxelGrid,
    rules: Rules,
    eps_m: float,
    margin_m: float,
    inset_m: float,
) -> Places:
    """One place in each empty voxel in or near a box (M, 7) that a clean point (N, 4) reaches.

    The source is the clean point nearest to the voxel's centre, and the place is the nearest one to it that
    lies `inset_m` inside of the voxel's faces. The voxels are those with a centre within `margin_m` of a box.
    With `along_ray`, the place is the nearest one on the ray of a clean point.
    """
    near = _near(clean, boxes, margin_m + eps_m)
    if not len(near):
        return _none()
    if rules.constraints.along_ray:
        source, offset = _steps_on_rays(clean, near, eps_m, min(grid.size_m))
    else:
        cells = _cells_about(grid.frame.boxes(boxes), grid, margin_m)
        source, offset = _nearest_in_cells(clean, near, cells, grid, eps_m, inset_m)
    places = _places(clean, source, offset, boxes, margin_m, eps_m, rules)
    return _one_a_voxel(places, grid, grid.keys(grid.cells(clean)))


def ball_places(
    clean: Float32,
    sources: Int64,
    count: int,
    boxes: Float64,
    rules: Rules,
    eps_m: float,
    margin_m: float,
    rng: np.random.Generator,
) -> Places:
    """`count` random places, each uniform in the ball around one of the sources, like those of the baseline
    `baselines.add_random_points`; fewer if the constraints permit hardly any."""
    drawn, have = [_none()], 0
    for _ in range(_MAX_DRAWS if len(sources) else 0):
        source = rng.choice(sources, size=count)
        offset = random_offsets(count, eps_m, rng)
        if rules.constraints.along_ray:
            offset = along_rays(clean[source, :3], offset)
        drawn.append(_places(clean, source, offset, boxes, margin_m, eps_m, rules))
        have += len(drawn[-1])
        if have >= count:
            break
    return joined(drawn)[np.arange(min(count, have))]


def _places(
    clean: Float32,
    source: Int64,
    offset_m: Float64,
    boxes: Float64,
    margin_m: float,
    eps_m: float,
    rules: Rules,
) -> Places:
    """The places at these offsets (K, 3) from clean points that the reach and the constraints permit."""
    start = clean[source, :3]
    points = clean[source].copy()
    points[:, :3] = move_within(start, offset_m * ROUNDING_FACTOR)
    distance_m = np.linalg.norm(points[:, :3].astype(np.float64) - start, axis=1)
    kept = np.flatnonzero((distance_m <= eps_m) & rules.permits(points[:, :3]))
    owner = owners(points[kept, :3], boxes, margin_m)
    return Places(points[kept], source[kept], distance_m[kept], owner)


def _cells_about(boxes: Float64, grid: VoxelGrid, margin_m: float) -> Int64:
    """The cells (K, 3) of a grid with a centre within a margin of any of the boxes (M, 7) in its frame."""
    low_m, size, shape = np.array(grid.low_m), np.array(grid.size_m), np.array(grid.shape)
    found = [np.zeros((0, 3), np.int64)]
    for box in boxes:
        half = np.append(np.full(2, np.hypot(box[3], box[4]) / 2), box[5] / 2) + 1.5 * margin_m
        first = np.clip(np.floor((box[:3] - half - low_m) / size).astype(np.int64), 0, shape)
        last = np.clip(np.floor((box[:3] + half - low_m) / size).astype(np.int64) + 1, 0, shape)
        axes = [np.arange(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        (inside,) = points_in_boxes(grid.low_corners_m(cells) + size / 2, box[None], margin_m)
        found.append(cells[inside])
    every = np.concatenate(found)
    _, first = np.unique(grid.keys(every), return_index=True)
    return every[first]


def _nearest_in_cells(
    clean: Float32, near: Int64, cells: Int64, grid: VoxelGrid, eps_m: float, inset_m: float
) -> tuple[Int64, Float64]:
    """For each cell (K, 3) that may be in reach, the clean point nearest to its centre, and the offset from
    that point into the cell."""
    low, size = grid.low_corners_m(cells), np.array(grid.size_m)
    reach_m = eps_m + float(np.linalg.norm(size)) / 2
    places = grid.frame.places(clean[near, :3].astype(np.float64))
    tree = cKDTree(places)
    distance_m, nearest = tree.query(low + size / 2, distance_upper_bound=reach_m)
    low = low[np.isfinite(distance_m)]
    found = nearest[np.isfinite(distance_m)]
    offset = np.clip(places[found], low + inset_m, low + size - inset_m) - places[found]
    return near[found], grid.frame.directions_back(offset)


def _steps_on_rays(clean: Float32, near: Int64, eps_m: float, voxel_m: float) -> tuple[Int64, Float64]:
    """Steps of half a voxel, forward and back, on the rays of clean points."""
    steps_m = np.arange(voxel_m / 2, eps_m, voxel_m / 2)
    steps_m = np.concatenate([-steps_m, steps_m, [-eps_m, eps_m]]) * ROUNDING_FACTOR
    start = clean[near, :3].astype(np.float64)
    unit = start / np.maximum(np.linalg.norm(start, axis=1, keepdims=True), 1e-9)
    return np.repeat(near, len(steps_m)), (unit[:, None] * steps_m[:, None]).reshape(-1, 3)


def _one_a_voxel(places: Places, grid: VoxelGrid, taken: Int64) -> Places:
    """In each empty voxel, the place nearest to its source."""
    key = grid.keys(grid.cells(places.points))
    order = np.lexsort((places.distance_m, key))
    order = order[(key[order] >= 0) & ~np.isin(key[order], taken)]
    _, first = np.unique(key[order], return_index=True)
    return places[order[first]]


def _near(points: Float32, boxes: Float64, margin_m: float) -> Int64:
    inside = points_in_boxes(points[:, :3], boxes, margin_m)
    return np.unique(np.concatenate([np.zeros(0, np.int64), *inside]))


def _none() -> Places:
    none = np.zeros(0, np.int64)
    return Places(np.zeros((0, 4), np.float32), none, np.zeros(0), none)


def joined(parts: list[Places]) -> Places:
    """All places of several parts, in order."""
    return Places(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.source for part in parts]),
        np.concatenate([part.distance_m for part in parts]),
        np.concatenate([part.owner for part in parts]),
    )
