"""What traffic signs show: the pictures on the retroreflective plates of the static world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.mesh import Mesh

Float32 = npt.NDArray[np.float32]

WHITE, BLACK, RED, BLUE, GREEN = np.array(
    [[0.85, 0.85, 0.83], [0.02, 0.02, 0.02], [0.55, 0.02, 0.03], [0.02, 0.09, 0.42], [0.01, 0.22, 0.12]],
    np.float32,
)

PLAIN, ROUND, TRIANGLE, SQUARE, OCTAGON, PANEL = range(6)
_SHAPE_OF_TRIANGLES = {14: ROUND, 1: TRIANGLE, 6: OCTAGON}
"""Shapes by the number of triangles of a convex plate; two are a square or a panel."""


@dataclass(frozen=True)
class SignFaces:
    """F plates. face_of_triangle: (T + 1,) int32, -1 for what is no plate. centres_m, right, up: (F, 3)
    float32; half_m: (F, 2) float32 along right and up. shapes: (F,) int64, as above. numbers: (F,) int64,
    which of a few pictures each shows."""

    face_of_triangle: npt.NDArray[np.int32]
    centres_m: Float32
    right: Float32
    up: Float32
    half_m: Float32
    shapes: npt.NDArray[np.int64]
    numbers: npt.NDArray[np.int64]

    @classmethod
    def of(cls, mesh: Mesh) -> SignFaces:
        """Find the plates of a mesh: connected triangles of the material `sign` in one plane."""
        chosen = np.flatnonzero(mesh.materials == MATERIAL_ID["sign"])
        face_of = np.full(len(mesh.triangles) + 1, -1, np.int32)
        corners = mesh.triangles[chosen]
        nodes, index = np.unique(corners, return_inverse=True)
        index = index.reshape(-1, 3)
        links = np.concatenate([index[:, [0, 1]], index[:, [1, 2]]])
        graph = coo_matrix((np.ones(len(links)), links.T), shape=(len(nodes), len(nodes)))
        count, part_of_node = connected_components(graph, directed=False)
        part = part_of_node[index[:, 0]] if len(index) else np.zeros(0, np.int64)
        face_of[chosen] = part
        sizes = np.bincount(part, minlength=count)
        table = np.array(
            [_face(mesh.vertices_m[nodes[part_of_node == part]], int(sizes[part])) for part in range(count)]
        ).reshape(-1, 12)
        numbers = np.abs(np.round(table[:, :3].sum(axis=1) * 7)).astype(np.int64)
        floats = table.astype(np.float32)
        return cls(
            face_of,
            floats[:, :3],
            floats[:, 3:6],
            floats[:, 6:9],
            floats[:, 9:11],
            table[:, 11].astype(np.int64),
            numbers,
        )

    def colours(self, triangles: npt.NDArray[np.intp], points_m: Float32) -> Float32:
        """The colours (N, 3) at points (N, 3) on triangles (N,) of the material `sign`."""
        face = self.face_of_triangle[triangles]
        away = points_m - self.centres_m[face]
        u = np.einsum("ij,ij->i", away, self.right[face]) / self.half_m[face, 0]
        v = np.einsum("ij,ij->i", away, self.up[face]) / self.half_m[face, 1]
        return _painted(self.shapes[face], self.numbers[face], u, v)


def _face(corners_m: Float64, triangles: int) -> list[float]:
    """Centre, axes to the right and up as a driver sees them, half sizes, and shape of one plate."""
    low, high = corners_m.min(axis=0), corners_m.max(axis=0)
    centre = (low + high) / 2
    level = np.linalg.svd((corners_m - centre)[:, :2], full_matrices=False)[2][0]
    right = np.array([level[0], level[1], 0.0])
    along = (corners_m - centre) @ right
    half = np.maximum([np.abs(along).max(), (high[2] - low[2]) / 2], 0.01)
    is_flat = np.abs((corners_m - centre) @ [-level[1], level[0], 0.0]).max() < 0.01
    shape = _SHAPE_OF_TRIANGLES.get(triangles, PLAIN) if is_flat else PLAIN
    if is_flat and triangles == 2:
        shape = PANEL if half[0] > 0.6 else SQUARE
    return [*centre, *right, 0.0, 0.0, 1.0, *half, shape]


def _painted(
    shapes: npt.NDArray[np.int64], numbers: npt.NDArray[np.int64], u: Float32, v: Float32
) -> Float32:
    """Colours (N, 3) at places in [-1, 1] on each plate."""
    colours = np.tile(WHITE, (len(u), 1))
    radius = np.hypot(u, v)
    odd = numbers % 2 == 1

    def paint(where: npt.NDArray[np.bool_], colour: Float32) -> None:
        colours[where] = colour

    of = shapes == ROUND
    paint(of & (radius > 0.74), RED)
    digits = (
        (np.abs(v) < 0.38)
        & (np.abs(np.abs(u) - 0.25) < 0.17)
        & ~((np.abs(np.abs(u) - 0.25) < 0.07) & (np.abs(v) < 0.28))
    )
    paint(of & odd & digits, BLACK)
    paint(of & ~odd & (np.abs(v) < 0.16) & (np.abs(u) < 0.6), BLACK)
    of = shapes == TRIANGLE
    border = np.minimum(v + 1, (1 - v) / 2 - np.abs(u)) < 0.22
    paint(of & border, RED)
    paint(of & ~border & (np.abs(u) < 0.08) & (np.abs(v + 0.25) < 0.35), BLACK)
    of = shapes == SQUARE
    paint(of & (np.maximum(np.abs(u), np.abs(v)) < 0.92), BLUE)
    arrow = ((np.abs(u) < 0.13) & (v < 0.35) & (v > -0.65)) | ((v > 0.2) & (np.abs(u) < (0.75 - v) * 0.8))
    paint(of & arrow, WHITE)
    of = shapes == OCTAGON
    paint(of & (radius < 0.93), RED)
    letters = (np.abs(v) < 0.25) & (np.abs(u) < 0.7) & (((u * 4 + 8) % 1) < 0.7)
    paint(of & letters, WHITE)
    of = shapes == PANEL
    ground = np.where(odd[:, None], BLUE, GREEN)
    inner = of & (np.abs(u) < 0.96) & (np.abs(v) < 0.94)
    colours[inner] = ground[inner]
    lines = (np.abs(np.abs(v - 0.02) - 0.42) < 0.17) & (u > -0.8) & (u < 0.55) & (((u * 9 + 18) % 1) < 0.68)
    paint(of & lines, WHITE)
    paint(of & (np.abs(u - 0.75) < 0.035) & (np.abs(v) < 0.6), WHITE)
    return colours
