"""The height of the ground: level with the roads beside them, hilly away from them."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.roads import Roads

GROUND_CELL_M = 6.5
EMBANKMENT_SLOPE = 0.5
"""Slope of embankments up to bridges."""

HILL_CELL_M = 16.0
HILL_M = (-2.0, 3.5)
"""How far hills fall and rise."""

STREET_CLEAR_M, FAST_CLEAR_M = 36.0, 10.0
"""Distance from the middle of a lane within which the ground follows the road: houses stand in it beside
streets; banks begin where it ends, beside fast roads."""

RAMP_M = {False: 30.0, True: 14.0}
"""Over which distance hills gain their height, beside streets and beside fast roads."""

TILE = 64


class Terrain:
    """The ground beside and between the roads; slopes: how hilly it is, in [0, 1]."""

    def __init__(self, roads: Roads, slopes: float, rng: np.random.Generator) -> None:
        self._roads, self._slopes = roads, slopes
        noise = rng.standard_normal((TILE, TILE))
        frequency = np.fft.fftfreq(TILE)
        radius = np.hypot(frequency[:, None], frequency)
        smooth = np.fft.ifft2(np.fft.fft2(noise) / (1 + (radius / 0.06) ** 2)).real
        self._hills = smooth / smooth.std()
        samples = np.concatenate([level.samples_m[:, :2] for level in roads.levels])
        fast = np.concatenate([level.fast for level in roads.levels])
        self._trees = {
            is_fast: cKDTree(samples[fast == is_fast]) for is_fast in (False, True) if (fast == is_fast).any()
        }

    def at(self, xy_m: Float64) -> Float64:
        """Height (N,) in metres at places (N, 2), without the unevenness of grass."""
        height_m = _beside_roads(xy_m, self._roads)
        return height_m + self._relief(xy_m) if self._slopes else height_m

    def _relief(self, xy_m: Float64) -> Float64:
        """Hills, which are zero within the clear distance of any road."""
        part = np.ones(len(xy_m))
        for is_fast, tree in self._trees.items():
            clear_m = FAST_CLEAR_M if is_fast else STREET_CLEAR_M
            reach_m = clear_m + RAMP_M[is_fast]
            away_m, _ = tree.query(xy_m, distance_upper_bound=reach_m)
            part = np.minimum(part, np.clip((away_m - clear_m) / RAMP_M[is_fast], 0.0, 1.0))
        there = np.flatnonzero(part > 0)
        hills = map_coordinates(self._hills, (xy_m[there] / HILL_CELL_M).T, order=1, mode="grid-wrap")
        relief = np.zeros(len(xy_m))
        rise = np.where(hills > 0, HILL_M[1], -HILL_M[0]) * hills
        relief[there] = self._slopes * part[there] * np.clip(rise, *HILL_M)
        return relief


def _beside_roads(xy_m: Float64, roads: Roads) -> Float64:
    """The ground is as high as the nearest road. Embankments slope up to bridges and never cover a lower
    road."""
    if roads.is_flat:
        return np.full(len(xy_m), roads.levels[0].samples_m[:, 2].mean())
    nearest_m = np.full(len(xy_m), np.inf)
    terrain = np.zeros(len(xy_m))
    rise = []
    for level in roads.levels:
        distances_m, nearest = level.tree.query(xy_m, k=list(range(1, 65)))
        heights_m = np.append(level.samples_m[:, 2], np.inf)[nearest]
        terrain = np.where(distances_m[:, 0] < nearest_m, heights_m[:, 0], terrain)
        nearest_m = np.minimum(nearest_m, distances_m[:, 0])
        # Subtract the size of a cell, so that none of its corners rises above a road that passes through it.
        beyond_m = np.maximum(np.where(np.isfinite(distances_m), distances_m, 0.0) - 1.5 * GROUND_CELL_M, 0.0)
        rise.append((heights_m + EMBANKMENT_SLOPE * beyond_m).min(axis=1))
    lowest: Float64 = np.minimum(terrain, np.min(rise, axis=0))
    return lowest
