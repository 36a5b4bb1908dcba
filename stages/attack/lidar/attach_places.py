"""The candidate places of `attach`: within reach of the clean cloud's points."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from advpipe.pipeline.adversary.constraints import Rules
from advpipe.pipeline.adversary.displacement import ROUNDING_MARGIN
from advpipe.pipeline.adversary.places import Places, no_places, places_at
from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.pipeline.geometry.boxes import points_in_boxes

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


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
        return no_places()
    if rules.constraints.along_ray:
        source, offset = _steps_on_rays(clean, near, eps_m, min(grid.size_m))
    else:
        cells = _cells_about(grid.frame.boxes(boxes), grid, margin_m)
        source, offset = _nearest_in_cells(clean, near, cells, grid, eps_m, inset_m)
    places = places_at(clean, source, offset, boxes, margin_m, eps_m, rules)
    return _one_a_voxel(places, grid, grid.keys(grid.cells(clean)))


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
    steps_m = np.concatenate([-steps_m, steps_m, [-eps_m, eps_m]]) * (1 - ROUNDING_MARGIN)
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
