"""Shapes that bodies and street furniture are made of, beyond the plain ones of `mesh`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge, surface

Profile = Sequence[tuple[float, float]]
Vector = Sequence[float]

_HALVES = np.array([[0, 1, 2], [0, 2, 3]])
"""The corners of the triangles of a sheet with four."""
_X_OF_CORNERS, _Z_OF_CORNERS = np.array([0, 1, 1, 0]), np.array([2, 2, 3, 3])
"""The columns of the sides of an upright rectangle that its corners have."""


def triangulated(area: shapely.Geometry) -> Float64:
    """The corners (T, 3, 2) of triangles that fill an area."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    corners: Float64 = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    return corners


def panels(area_xz: shapely.Geometry, half_width: Callable[[Float64], Float64], material: str) -> Mesh:
    """A side view as a sheet on both sides of a body: y = +-`half_width` of its points (N, 2)."""
    corners = triangulated(area_xz).reshape(-1, 2)
    y = half_width(corners)
    left = np.column_stack([corners[:, 0], y, corners[:, 1]])
    faces = np.arange(2 * len(corners)).reshape(-1, 3)
    return surface(np.concatenate([left, left * (1, -1, 1)]), faces, material)


def band(profile_xz: Profile, half_width_m: Sequence[float], materials: Sequence[str | None]) -> Mesh:
    """The sheet across a body along an open side view; a piece without material is left open."""
    points = [[(x, half, z), (x, -half, z)] for (x, z), half in zip(profile_xz, half_width_m, strict=True)]
    pieces = zip(points, points[1:], materials, strict=False)
    return merge(surface([*a, *b], [[0, 1, 2], [1, 3, 2]], material) for a, b, material in pieces if material)


def quad(corners_m: npt.ArrayLike, material: str) -> Mesh:
    """A sheet with four corners (4, 3), in order around it."""
    return surface(corners_m, [[0, 1, 2], [0, 2, 3]], material)


def quads(corners_m: npt.ArrayLike, material: str) -> Mesh:
    """Sheets with four corners (N, 4, 3) each, in order around them."""
    points = np.asarray(corners_m, dtype=np.float64).reshape(-1, 3)
    first = np.arange(0, len(points), 4)[:, None]
    return surface(points, np.concatenate([first + _HALVES[0], first + _HALVES[1]]), material)


def upright(sides_m: npt.ArrayLike, y_m: float | Float64, material: str) -> Mesh:
    """Upright rectangles in planes y = `y_m`, from their sides (N, 4): x from, x to, z from, z to."""
    sides = np.asarray(sides_m, dtype=np.float64).reshape(-1, 4)
    corners = np.empty((len(sides), 4, 3))
    corners[:, :, 0] = sides[:, _X_OF_CORNERS]
    corners[:, :, 1] = np.asarray(y_m, dtype=np.float64).reshape(-1, 1)
    corners[:, :, 2] = sides[:, _Z_OF_CORNERS]
    return quads(corners, material)


def limbs(
    starts_m: Float64, ends_m: Float64, radii_m: Float64, material: str, sides: int = 3, taper: float = 0.6
) -> Mesh:
    """Open tubes from points (N, 3) to points (N, 3), which narrow from their radius (N,) to `taper` of it.

    With two sides, they are flat.
    """
    axis = ends_m - starts_m
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
    across = np.cross(axis, np.where(np.abs(axis[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(axis, across)
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * other[:, None]
    low = starts_m[:, None] + radii_m[:, None, None] * ring
    high = ends_m[:, None] + taper * radii_m[:, None, None] * ring
    here = np.arange(sides if sides > 2 else 1)
    after = (here + 1) % sides
    corners = np.stack([low[:, here], low[:, after], high[:, after], high[:, here]], axis=2)
    return quads(corners.reshape(-1, 4, 3), material)


def wheel(x_m: float, y_m: float, radius_m: float, tread_m: float, sides: int = 12) -> Mesh:
    """A tyre on the ground with its rim; its outer side is at `y_m`."""
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.zeros(sides), np.sin(angle)])
    hub = np.array([x_m, y_m, radius_m])
    inward = np.array([0.0, -np.sign(y_m) * tread_m, 0.0])
    rings = [
        hub + inward + radius_m * circle,
        hub + radius_m * circle,
        hub + 0.62 * radius_m * circle,
        hub + 0.2 * inward + 0.58 * radius_m * circle,
    ]
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides

    def around(a: int, b: int) -> npt.NDArray[np.int64]:
        lower, upper = np.stack([i, j, i + sides], axis=1), np.stack([j, j + sides, i + sides], axis=1)
        shift = np.where(np.concatenate([lower, upper]) >= sides, (b - 1) * sides, a * sides)
        faces: npt.NDArray[np.int64] = np.concatenate([lower, upper]) + shift
        return faces

    points = np.concatenate(rings)
    fan = np.stack([np.full(sides - 2, 3 * sides), 3 * sides + i[1:-1], 3 * sides + i[2:]], axis=1)
    rubber = surface(points, np.concatenate([around(0, 1), around(1, 2)]), "rubber")
    return merge([rubber, surface(points, fan, "rim")])


def hoop(centre_m: Vector, radius_m: float, depth_m: float, half_tread_m: float, sides: int = 12) -> Mesh:
    """A spoked wheel in the x-z plane: its tyre, and nothing between the spokes."""
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.zeros(sides), np.sin(angle)])
    side = np.array([0.0, half_tread_m, 0.0])
    outer, inner = radius_m * circle, (radius_m - depth_m) * circle
    points = np.concatenate([outer + side, outer - side, inner]) + np.asarray(centre_m)
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    pairs = [(0, 1), (0, 2), (1, 2)]
    faces = [
        np.concatenate(
            [
                np.stack([i + a * sides, j + a * sides, i + b * sides], axis=1),
                np.stack([j + a * sides, j + b * sides, i + b * sides], axis=1),
            ]
        )
        for a, b in pairs
    ]
    return surface(points, np.concatenate(faces), "rubber")
