"""Gaps between leaves, as a camera sees them: each triangle of foliage stands for a spray of leaves."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID

Bool = npt.NDArray[np.bool_]
Float32 = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]

SIZE, CELL_M = 256, 0.01
"""Side of the tile of leaves in cells, a power of two, and of a cell."""


class LeafShape(NamedTuple):
    """Length and width of a leaf, and the share of a spray's area that leaves cover."""

    length_m: float
    width_m: float
    cover: float


SHAPES: Mapping[str, LeafShape] = {
    "foliage": LeafShape(0.17, 0.09, 0.68),
    "conifer": LeafShape(0.26, 0.035, 0.68),
}
"""By material. Leaves are larger than those of most trees: at the distance of a road's verge, pixels are
centimetres wide."""


class LeafGaps:
    """The gaps of a mesh.

    vertices_m: (V, 3). triangles: (T, 3). materials: (T,) uint8.
    """

    def __init__(
        self, vertices_m: Float32, triangles: npt.NDArray[np.uint32], materials: npt.NDArray[np.uint8]
    ) -> None:
        self._tiles = np.concatenate([leaf_tile(shape) for shape in SHAPES.values()])
        kind_of_material = np.full(256, -1, np.int8)
        kind_of_material[[MATERIAL_ID[name] for name in SHAPES]] = np.arange(len(SHAPES))
        kinds = kind_of_material[materials]
        leafy = np.flatnonzero(kinds >= 0)
        self.has_any = len(leafy) > 0
        # The last entry, beyond the triangles, is for rays that hit nothing.
        self._places = np.full(len(kinds) + 1, -1, np.int32)
        self._places[leafy] = np.arange(len(leafy))
        self._kinds = kinds[leafy].astype(np.int32)
        corners = vertices_m[triangles[leafy]]
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        long_m = np.maximum(np.linalg.norm(first, axis=1), np.float32(1e-6))
        along_m = (first * second).sum(axis=1) / long_m
        across_m = np.linalg.norm(np.cross(first, second), axis=1) / long_m
        self._sides = np.stack([long_m, along_m, across_m]) / np.float32(CELL_M)
        numbers = leafy.astype(np.uint32)
        self._shifts = np.stack([_scrambled(numbers), _scrambled(numbers + np.uint32(1 << 30))])

    def open_rays(self, triangles: Int32, uv: Float32) -> npt.NDArray[np.int64]:
        """Indices of those of N hits that meet a gap: triangles (N,), barycentric places in them (N, 2)."""
        places = np.take(self._places, triangles)
        leafy = np.flatnonzero(places >= 0)
        places = np.take(places, leafy)
        u, v = np.take(uv, leafy, axis=0).T
        long, along, across = np.take(self._sides, places, axis=1)
        columns, rows = (u * long + v * along).astype(np.int32), (v * across).astype(np.int32)
        columns += np.take(self._shifts[0], places)
        rows += np.take(self._shifts[1], places)
        columns &= SIZE - 1
        rows &= SIZE - 1
        rows += SIZE * np.take(self._kinds, places)
        rows *= SIZE
        rows += columns
        gaps: npt.NDArray[np.int64] = leafy[~np.take(self._tiles, rows)]
        return gaps


def _scrambled(numbers: npt.NDArray[np.uint32]) -> Int32:
    """A shift (N,) of the tile for each number."""
    mixed = numbers * np.uint32(2654435761)
    mixed ^= mixed >> np.uint32(15)
    mixed *= np.uint32(2246822519)
    shift: Int32 = (mixed >> np.uint32(16)).astype(np.int32)
    return shift


@cache
def leaf_tile(shape: LeafShape) -> Bool:
    """Whether there is a leaf (SIZE²,): row by row, periodic; leaves are pointed and lie anywhere."""
    rng = np.random.default_rng(20260103)
    tile = np.zeros((SIZE, SIZE), np.bool_)
    half = int(np.ceil(shape.length_m / 2 / CELL_M))
    y, x = np.mgrid[-half : half + 1, -half : half + 1] * CELL_M
    while tile.mean() < shape.cover:
        angle, (row, column) = rng.uniform(0, np.pi), rng.integers(SIZE, size=2)
        along = (x * np.cos(angle) + y * np.sin(angle)) / (shape.length_m / 2)
        across = (y * np.cos(angle) - x * np.sin(angle)) / (shape.width_m / 2)
        leaf = np.abs(across) < 1 - along**2
        rows, columns = np.arange(row - half, row + half + 1), np.arange(column - half, column + half + 1)
        tile[np.ix_(rows % SIZE, columns % SIZE)] |= leaf
    return tile.ravel()
