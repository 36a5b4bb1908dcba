"""The options of each point to move into another voxel: the cells in its reach and the shortest way there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.displacement import ROUNDING_MARGIN
from advpipe.pipeline.attack_detection.voxel_face import AT_FACE_M, face_distance_m
from advpipe.pipeline.baselines import move_within
from advpipe.pipeline.detector.protocol import VoxelGrid

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

MAX_CELLS_AWAY = 2
"""The most cells that a point moves along each axis: farther cells are no better."""

MIN_DEPTH_M = 0.01
"""Points that spread in a voxel need so much of their ray in it, or they would crowd at its face."""


@dataclass(frozen=True)
class Crossings:
    """The L options of P points: each is a cell that a point can move into, and the shortest way there.

    point: (L,) which point, ascending. cell: (L,) index into `keys`. offset_m: (L, 3) float64 from the
    point's place in the clean cloud; zero for staying. length_m: (L,). home: (P,) the option of staying.
    keys: (C,) the cells in reach of any point, as `VoxelGrid.keys`.
    """

    point: Int64
    cell: Int64
    offset_m: Float64
    length_m: Float64
    home: Int64
    keys: Int64


def find_crossings(
    start: Float32,
    grid: VoxelGrid,
    reach_m: float,
    landing_m: float,
    along_ray: bool = False,
    forbidden: Callable[[Float64], Bool] | None = None,
    spread: np.random.Generator | None = None,
) -> Crossings:
    """The options of points (P, 3), all inside of the grid, within a reach.

    landing_m: how far behind a face a point lands, or on the way back into the middle of a smaller cell.
    along_ray: points move only on their ray from the origin. spread: points on rays land anywhere in the
    voxel, as it draws, instead of behind its face, and no more often at a face than they lay before.
    forbidden: marks excluded places among (K, 3).
    """
    low, size = np.array(grid.low_m), np.array(grid.size_m)
    cells = grid.cells(start)
    inset = np.zeros(3) if spread else np.minimum(landing_m, 0.45 * size)
    away = [range(-n, n + 1) for n in (min(math.ceil(reach_m / s), MAX_CELLS_AWAY) for s in grid.size_m)]
    place = grid.frame.places(start.astype(np.float64))
    ray = grid.frame.directions(_unit(start.astype(np.float64)))
    point, offset, target = [], [], []
    for step in itertools.product(*away):
        if step == (0, 0, 0):
            here, way = np.arange(len(start)), np.zeros_like(place)
        else:
            first = low + (cells + step) * size + inset - place  # to the shrunken cell's faces
            last = first + size - 2 * inset
            here, way = (
                _along_rays(ray, first, last, reach_m, spread)
                if along_ray
                else (np.arange(len(start)), np.clip(0.0, first, last))
            )
        fits = np.linalg.norm(way, axis=1) <= reach_m * (1 - ROUNDING_MARGIN)
        point.append(here[fits])
        offset.append(grid.frame.directions_back(way[fits]) * (1 - ROUNDING_MARGIN))
        target.append(cells[here[fits]] + step)
    points, offsets, targets = np.concatenate(point), np.concatenate(offset), np.concatenate(target)
    arrived = move_within(start[points], offsets)
    stays: Bool = np.asarray(np.equal(offsets, 0).all(axis=1))
    there: Bool = (grid.cells(arrived) == targets).all(axis=1) & (grid.keys(targets) >= 0)
    valid = there | stays
    if spread is not None:
        valid &= stays | _accepted_at_faces(start, arrived, valid & ~stays, grid, spread)
    if forbidden is not None:
        check = np.flatnonzero(valid & ~stays)
        valid[check[forbidden(arrived[check].astype(np.float64))]] = False
    order = np.flatnonzero(valid)[np.lexsort((~stays[valid], points[valid]))]
    keys, cell = np.unique(grid.keys(targets[order]), return_inverse=True)
    home = np.searchsorted(points[order], np.arange(len(start)))  # staying comes first
    return Crossings(
        point=points[order],
        cell=cell.astype(np.int64),
        offset_m=offsets[order],
        length_m=np.linalg.norm(offsets[order], axis=1),
        home=home.astype(np.int64),
        keys=keys,
    )


def _accepted_at_faces(
    start: Float32, arrived: Float32, moved: Bool, grid: VoxelGrid, rng: np.random.Generator
) -> Bool:
    """Accepts landing places (L, 3) at voxel faces with the probability at which as large a share of those
    that `moved` lies there as of the points (P, 3); all others always.

    Where the reach of a point ends just behind a face, its places crowd there.
    """
    at_face = face_distance_m(arrived, grid) <= AT_FACE_M
    before = float((face_distance_m(start, grid) <= AT_FACE_M).mean()) if len(start) else 0.0
    after = float(at_face[moved].mean()) if moved.any() else 0.0
    chance = 1.0 if after <= before else before * (1 - after) / (after * (1 - before))
    accepted: Bool = ~at_face | (rng.random(len(at_face)) < chance)
    return accepted


def _unit(place: Float64) -> Float64:
    """The directions (P, 3) from the LiDAR to places (P, 3)."""
    unit: Float64 = place / np.maximum(np.linalg.norm(place, axis=1, keepdims=True), 1e-9)
    return unit


def _along_rays(
    ray: Float64, first: Float64, last: Float64, reach_m: float, spread: np.random.Generator | None
) -> tuple[Int64, Float64]:
    """The points whose rays (P, 3) meet their box, from `first` to `last` relative to them, and the shortest
    way into it along the ray (slab method); with `spread`, a random way within reach."""
    ray = np.where(np.abs(ray) < 1e-12, 1e-12, ray)
    a, b = first / ray, last / ray
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    if spread:
        enter, leave = np.maximum(enter, -reach_m), np.minimum(leave, reach_m)
        meets = np.flatnonzero(leave - enter >= MIN_DEPTH_M)
        way = enter[meets] + (leave - enter)[meets] * spread.random(len(meets))
        return meets, way[:, None] * ray[meets]
    meets = np.flatnonzero(enter <= leave)
    way = np.clip(0.0, enter[meets], leave[meets])
    return meets, way[:, None] * ray[meets]
