"""Triangle meshes with a material per triangle, and primitives to build them from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID


@dataclass(frozen=True)
class Mesh:
    """V vertices and T triangles.

    vertices_m: (V, 3) float64. triangles: (T, 3) int64, index into the vertices.
    materials: (T,) uint8, index into `materials.REFLECTIVITY`.
    """

    vertices_m: Float64
    triangles: npt.NDArray[np.int64]
    materials: npt.NDArray[np.uint8]

    def unit_normals(self) -> Float64:
        """The normal (T, 3) of each triangle, to the side from which its corners run anticlockwise."""
        a, b, c = (self.vertices_m[self.triangles[:, corner]] for corner in range(3))
        normals = np.cross(b - a, c - a)
        unit: Float64 = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return unit

    def transformed(self, a_SE3_b: Float64) -> Mesh:
        """The mesh, given in frame b, in frame a."""
        return Mesh(transform_points(a_SE3_b, self.vertices_m), self.triangles, self.materials)

    def scaled(self, x: float, y: float, z: float) -> Mesh:
        """The mesh scaled along each axis by a factor."""
        return Mesh(self.vertices_m * (x, y, z), self.triangles, self.materials)

    def moved(self, x_m: float, y_m: float, z_m: float) -> Mesh:
        """The mesh translated along each axis."""
        return Mesh(self.vertices_m + (x_m, y_m, z_m), self.triangles, self.materials)


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """All meshes as one."""
    parts = list(meshes)
    if not parts:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros(0, np.uint8))
    starts = np.cumsum([0] + [len(part.vertices_m) for part in parts[:-1]])
    return Mesh(
        np.concatenate([part.vertices_m for part in parts]),
        np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.materials for part in parts]),
    )


def _box_faces() -> npt.NDArray[np.int64]:
    """The triangles of a box: its sides, its floor, and its lid, which has corners of its own."""
    sides = [[i, (i + 1) % 4, (i + 1) % 4 + 4] for i in range(4)]
    sides += [[i, (i + 1) % 4 + 4, i + 4] for i in range(4)]
    return np.array([*sides, [0, 2, 1], [0, 3, 2], [12, 13, 14], [12, 14, 15]], np.int64)


_BOX_FACES, _LID_FACES = _box_faces(), 2
_UNIT_BOX = np.array([(x, y, z) for z in (0, 1) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))], np.float64)


def surface(vertices_m: npt.ArrayLike, triangles: npt.ArrayLike, material: str) -> Mesh:
    """A mesh of vertices (V, 3) in metres and triangles (T, 3) with one material of `MATERIAL_ID`."""
    faces = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    ids = np.full(len(faces), MATERIAL_ID[material], np.uint8)
    return Mesh(np.asarray(vertices_m, dtype=np.float64).reshape(-1, 3), faces, ids)


def strip(left_m: Float64, right_m: Float64, material: str) -> Mesh:
    """The band between two polylines (K, 3)."""
    count = len(left_m)
    i = np.arange(count - 1)
    faces = np.concatenate(
        [np.stack([i, i + count, i + 1], axis=1), np.stack([i + 1, i + count, i + count + 1], axis=1)]
    )
    return surface(np.concatenate([left_m, right_m]), faces, material)


def box_mesh(size_m: Sequence[float], material: str, top: str | None = None) -> Mesh:
    """A box of length, width and height on z = 0, centred in x and y; `top`: material of its upper side."""
    length, width, height = size_m
    corners = _UNIT_BOX * (length / 2, width / 2, height)
    materials = np.full(len(_BOX_FACES), MATERIAL_ID[material], np.uint8)
    materials[-_LID_FACES:] = MATERIAL_ID[top or material]
    return Mesh(np.concatenate([corners, corners]), _BOX_FACES, materials)


def tube(
    start_m: Sequence[float], end_m: Sequence[float], radius_m: float, material: str, sides: int = 8
) -> Mesh:
    """A closed cylinder between two points."""
    a, b = np.asarray(start_m, dtype=np.float64), np.asarray(end_m, dtype=np.float64)
    axis = (b - a) / np.linalg.norm(b - a)
    x, y, z = axis
    across = np.array([y, -x, 0.0] if abs(z) < 0.9 else [0.0, z, -y])
    across /= np.linalg.norm(across)
    other = np.array(
        [y * across[2] - z * across[1], z * across[0] - x * across[2], x * across[1] - y * across[0]]
    )
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius_m * (np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * other)
    vertices = np.concatenate([a + ring, b + ring, [a, b]])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [
        np.stack([i, j, i + sides], axis=1),
        np.stack([j, j + sides, i + sides], axis=1),
        np.stack([np.full(sides, 2 * sides), j, i], axis=1),
        np.stack([np.full(sides, 2 * sides + 1), i + sides, j + sides], axis=1),
    ]
    return surface(vertices, np.concatenate(faces), material)


def ellipsoid(centre_m: Sequence[float], radii_m: Sequence[float], material: str, rings: int = 5) -> Mesh:
    """An ellipsoid of `rings` bands of latitude."""
    columns = 2 * rings
    polar = np.pi * np.arange(rings + 1) / rings
    around = 2 * np.pi * np.arange(columns) / columns
    unit = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.sin(polar)[:, None] * np.sin(around),
            np.broadcast_to(np.cos(polar)[:, None], (rings + 1, columns)),
        ],
        axis=-1,
    )
    vertices = unit.reshape(-1, 3) * radii_m + np.asarray(centre_m)
    row, column = np.meshgrid(np.arange(rings), np.arange(columns), indexing="ij")
    a, b = row * columns + column, row * columns + (column + 1) % columns
    faces = np.stack([a, a + columns, b, b, a + columns, b + columns], axis=-1).reshape(-1, 3)
    return surface(vertices, faces, material)
