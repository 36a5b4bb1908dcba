"""How the static world looks: the colour of each of its triangles, and the textures over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.stages.simulate.world.raycast.materials import (
    COLOUR,
    MATERIAL_ID,
    SEMANTIC,
    SEMANTIC_CLASSES,
    TEXTURE,
)
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.sign_faces import SignFaces
from advpipe.stages.simulate.world.raycast.textures import TEXTURES, Patch

Float32 = npt.NDArray[np.float32]
UInt8 = npt.NDArray[np.uint8]

HOUSE_TINTS = np.array(
    [[1.0, 1.0, 1.0], [1.05, 0.94, 0.8], [0.92, 0.98, 1.04], [1.08, 0.86, 0.72], [0.8, 0.84, 0.86],
     [1.02, 1.0, 0.78], [0.9, 0.72, 0.62], [0.72, 0.8, 0.74], [1.1, 1.08, 1.05]],
    np.float32,
)  # fmt: skip
"""Factors on the colours of walls and roofs; each house has one."""

_STEEP = np.float32(0.7)


class StaticLook:
    """The colours of a static mesh; footprints: outlines of its houses."""

    def __init__(self, mesh: Mesh, footprints: Sequence[shapely.Polygon], rng: np.random.Generator) -> None:
        self._materials = np.append(mesh.materials, np.uint8(0))
        self._colours = COLOUR[self._materials]
        self._faces = SignFaces.of(mesh)
        middles = mesh.vertices_m[mesh.triangles].mean(axis=1) if len(mesh.triangles) else np.zeros((0, 3))
        self._tint_leaves(rng)
        self._tint_houses(middles[:, :2], footprints, rng)
        self._channels = [np.ascontiguousarray(channel) for channel in self._colours.T]

    def _tint_leaves(self, rng: np.random.Generator) -> None:
        leaves = np.flatnonzero([TEXTURE[each] == "leaves" for each in self._materials])
        light = rng.uniform(0.75, 1.2, (len(leaves), 1))
        yellow = rng.uniform(0.85, 1.25, len(leaves))
        self._colours[leaves] *= (
            light * np.stack([yellow, np.ones(len(leaves)), 2 - yellow], axis=1)
        ).astype(np.float32)

    def _tint_houses(
        self,
        middles_m: npt.NDArray[np.float64],
        footprints: Sequence[shapely.Polygon],
        rng: np.random.Generator,
    ) -> None:
        is_house = SEMANTIC[self._materials[:-1]] == SEMANTIC_CLASSES.index("building")
        walls = np.flatnonzero(is_house & (self._materials[:-1] != MATERIAL_ID["pane"]))
        if not len(footprints) or not len(walls):
            return
        house = shapely.STRtree(footprints).nearest(shapely.points(middles_m[walls]))
        tints = HOUSE_TINTS[rng.integers(len(HOUSE_TINTS), size=len(footprints))]
        self._colours[walls] = np.minimum(self._colours[walls] * tints[house], np.float32(0.9))

    def paint(
        self,
        colour: Float32,
        present: UInt8,
        counts: npt.NDArray[np.intp],
        triangles: npt.NDArray[np.int32],
        points_m: Float32,
        normals: Float32,
        detail_m: Float32,
    ) -> None:
        """Write the colours of the first N of K points (3, K), which are in the order of `BY_TEXTURE`.

        colour, normals: (3, K). present, counts: (M,), the materials and how many points are of each.
        triangles: (N,). detail_m: (K,), size of a pixel there.
        """
        places = triangles.astype(np.intp)
        for channel in range(3):
            np.take(self._channels[channel], places, out=colour[channel, : len(places)], mode="clip")
        ends = np.cumsum(counts).tolist()
        start = 0
        for index, (material, end) in enumerate(zip(present.tolist(), ends, strict=True)):
            texture = TEXTURE[material]
            if texture != "plain" and index + 1 < len(ends) and TEXTURE[present[index + 1]] == texture:
                continue  # all that have one texture are painted at once
            part = slice(start, end)
            start = end
            if texture != "plain":
                patch = _patch(points_m[:, part], normals[:, part], detail_m[part])
                colour[:, part] *= TEXTURES[texture](patch)
            elif material == MATERIAL_ID["sign"]:
                colour[:, part] = self._faces.colours(places[part], points_m[:, part].T).T


def _patch(points_m: Float32, normals: Float32, detail_m: Float32) -> Patch:
    """Coordinates in the surface: those of the map on level ground, along and up on walls."""
    x_m, y_m, z_m = points_m
    steep = np.flatnonzero(np.abs(normals[2]) < _STEEP)
    if not len(steep):
        return Patch(x_m, y_m, z_m, detail_m)
    along_m, up_m = x_m.copy(), y_m.copy()
    across_x, across_y = normals[0, steep], normals[1, steep]
    length = np.maximum(np.hypot(across_x, across_y), np.float32(1e-6))
    along_m[steep] = (y_m[steep] * across_x - x_m[steep] * across_y) / length
    up_m[steep] = z_m[steep]
    return Patch(along_m, up_m, z_m, detail_m)
