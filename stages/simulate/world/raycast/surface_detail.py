"""How reflectivity and height vary over the surfaces of the static world, as a LiDAR notices it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.world import SurfaceDetail
from advpipe.stages.simulate.world.raycast.materials import (
    MATERIALS,
    RETROREFLECTIVE,
    SEMANTIC,
    SEMANTIC_CLASSES,
    TRANSMITTANCE,
)
from advpipe.stages.simulate.world.raycast.textures import SIZE, cloudy_tile, grain_tile

Float32 = npt.NDArray[np.float32]

GRAIN_M, STAIN_BITS = 0.08, 2
"""Side of the cells of relief and grain; those of stains are 2^2 times as large, stains up to 500 cells."""

GRAIN = 0.55
"""Contrast of the grain relative to that of the stains."""

FARTHEST_M = np.float32(1000.0)
"""Stands for an infinite range, where nothing is hit."""

CRACK = np.float32(0.012)
"""Cracks run where the stains pass zero, on this share of either side; on asphalt some 1 % of the surface."""

PAINT_GLOSS, TRIM_GLOSS = 0.5, 0.3
"""Share of the light of a painted body, and of rims, tyres and trim, that is returned only near the normal:
flakes and clear coat lie parallel to the panel. With it, dark and metallic cars give hardly any return at a
slant, white ones do. Fitted to the intensities on cars of real clouds, whose median is 0."""


class Roughness(NamedTuple):
    """contrast: relative standard deviation of the reflectivity. relief_m: that of the height."""

    contrast: float
    relief_m: float


ROUGHNESS: Mapping[str, Roughness] = {
    "road": Roughness(0.22, 0.004),
    "marking": Roughness(0.20, 0.003),
    "pavement": Roughness(0.18, 0.005),
    "ground": Roughness(0.22, 0.012),
    "vegetation": Roughness(0.15, 0.03),
    "building": Roughness(0.16, 0.022),
    "pole": Roughness(0.08, 0.0),
    "sign": Roughness(0.05, 0.0),
    "barrier": Roughness(0.15, 0.004),
    "vehicle": Roughness(0.0, 0.0),
    "person": Roughness(0.0, 0.0),
    "other": Roughness(0.12, 0.004),
}
"""By semantic class. Relief of 4 mm is that of asphalt with its ruts, 1 to 2 cm that of rendered and brick
walls with joints, sills and pipes. Moving bodies have none: a pattern fixed in the map would swim on them."""

_CONTRAST, _RELIEF_M = np.array(
    [ROUGHNESS[SEMANTIC_CLASSES[index]] for index in SEMANTIC], np.float32
).T.copy()
_CONTRAST[RETROREFLECTIVE | (TRANSMITTANCE > 0)] = 0
_RELIEF_M[RETROREFLECTIVE | (TRANSMITTANCE > 0)] = 0
_MASK = SIZE - 1
_IS_CRACKED: npt.NDArray[np.bool_] = np.equal(SEMANTIC, SEMANTIC_CLASSES.index("road"))
_IS_TRIM = np.equal(SEMANTIC, SEMANTIC_CLASSES.index("vehicle")) & ~RETROREFLECTIVE & (TRANSMITTANCE == 0)
_GLOSS = np.where(_IS_TRIM, np.float32(TRIM_GLOSS), np.float32(0))
_GLOSS[[name.startswith("paint") for name in MATERIALS]] = PAINT_GLOSS
_GLOSS[list(MATERIALS).index("interior")] = 0


class DetailMap:
    """The detail of every place of the map. shift_m: (2,), moves the pattern: each seed has its own."""

    def __init__(self, shift_m: npt.NDArray[np.float64]) -> None:
        self._shift_m = shift_m.astype(np.float32)

    def at(
        self,
        rays: Float32,
        range_m: Float32,
        materials: npt.NDArray[np.uint8],
        is_fixed: npt.NDArray[np.bool_],
    ) -> SurfaceDetail:
        """The detail at hits (R,) of rays (R, 6); is_fixed: (R,), whether each is on the static world."""
        far_m = np.minimum(range_m, FARTHEST_M)
        # The ground is seen from above, and a wall in any direction but one at a slant.
        column = self._cell(rays, far_m, 0, np.float32(0.6))
        row = self._cell(rays, far_m, 1, np.float32(-0.8))
        fine = _looked_up(grain_tile(), row, column)
        row >>= STAIN_BITS
        column >>= STAIN_BITS
        stains = _looked_up(cloudy_tile(), row, column)
        fine *= is_fixed
        stains *= is_fixed
        kinds = materials.astype(np.intp)
        cracks = np.flatnonzero((np.abs(stains) < CRACK) & is_fixed)
        cracks = cracks[_IS_CRACKED[kinds[cracks]]]
        relief_m = np.take(_RELIEF_M, kinds, mode="clip")
        relief_m *= fine
        texture = fine
        texture *= np.float32(GRAIN)
        texture += stains
        texture *= np.take(_CONTRAST, kinds, mode="clip")
        texture += 1
        np.clip(texture, np.float32(0.2), np.float32(1.8), out=texture)
        texture[cracks] *= np.float32(0.5)
        return SurfaceDetail(texture, relief_m, np.take(_GLOSS, kinds, mode="clip"))

    def _cell(self, rays: Float32, far_m: Float32, axis: int, of_height: np.float32) -> npt.NDArray[np.int32]:
        """The cells (R,) along one axis of the pattern, in which height counts, too."""
        place_m = rays[:, 5] * of_height
        place_m += rays[:, 3 + axis]
        place_m *= far_m
        place_m += rays[:, axis]
        # One height for all origins of a turn: a vehicle rises by millimetres in that time.
        place_m += rays[0, 2] * of_height + self._shift_m[axis]
        place_m *= np.float32(1 / GRAIN_M)
        cells: npt.NDArray[np.int32] = np.floor(place_m, out=place_m).astype(np.int32)
        return cells


def _looked_up(tile: Float32, row: npt.NDArray[np.int32], column: npt.NDArray[np.int32]) -> Float32:
    """The values (R,) of a periodic tile in these cells."""
    place = row & _MASK
    place *= SIZE
    place |= column & _MASK
    return np.take(tile, place, mode="clip")  # the places are inside; "clip" is the fastest
