"""What stands beside fast roads: noise barriers, bushes and trees; the banks are the terrain's."""

from __future__ import annotations

import itertools

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.environment import Environment
from advpipe.stages.simulate.world.raycast import furniture
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.plots import Plot, plots_along
from advpipe.stages.simulate.world.raycast.site import Site
from advpipe.stages.simulate.world.raycast.templates import Plants

BARRIER_OFFSET_M = 4.2
BARRIER_STRETCH = 24
"""Points of a verge, some 4 m apart, that have a noise barrier or none."""

LEVEL_M = 1.5
"""Beside a bridge, where the ground lies more than this below the road, nothing stands near it."""

FAR_OFFSET_M = (6.0, 25.0)


def build_roadsides(
    site: Site,
    verges_m: tuple[Float64, ...],
    environment: Environment,
    plants: Plants,
    rng: np.random.Generator,
) -> None:
    """Posts and signs, noise barriers, trees and bushes, along the verges of fast roads and bridges."""
    for verge in verges_m:
        for start in range(0, len(verge) - 1, BARRIER_STRETCH):
            if rng.random() < 0.3 * environment.fences:
                _noise_barrier(site, verge[start : start + BARRIER_STRETCH + 1], rng)
    for plot, _ in plots_along(verges_m, environment.poles_per_km, rng):
        mesh, side_m, offset_m = _post(rng)
        site.place(mesh, plot.at(offset_m), side_m, side_m)
    for per_km, draw, side_m in (
        (1.5 * environment.trees_per_km, plants.tree, 1.6),
        (0.8 * environment.bushes_per_km, plants.bush, 1.5),
        (1.2 * environment.bushes_per_km, plants.tall_grass, 0.5),
    ):
        for plot, _ in plots_along(verges_m, per_km, rng):
            pose = plot.at(rng.uniform(*FAR_OFFSET_M))
            pose[2, 3] = site.ground_m(pose[:2, 3])
            site.place(draw(rng), pose, side_m, side_m)


def _post(rng: np.random.Generator) -> tuple[Mesh, float, float]:
    """A delineator or a sign, the side of the square that it takes, and its distance from the verge."""
    if rng.random() < 0.6:
        return furniture.delineator(rng), 0.2, 1.4
    return furniture.traffic_sign(rng), 1.8, 2.6


def _noise_barrier(site: Site, verge_m: Float64, rng: np.random.Generator) -> None:
    """Panels of 4 m between posts, where the ground is level with the road."""
    height_m = rng.uniform(2.2, 4.0)
    for a, b in itertools.pairwise(verge_m):
        step = b - a
        long_m = float(np.linalg.norm(step[:2]))
        if long_m < 0.5:
            continue
        pose = Plot((a + b) / 2, float(np.arctan2(step[1], step[0]))).at(BARRIER_OFFSET_M)
        ground_m = site.ground_m(pose[:2, 3])
        if abs(ground_m - pose[2, 3]) > LEVEL_M:
            continue
        pose[2, 3] = ground_m
        panel = box_mesh((long_m + 0.2, 0.14, height_m + 0.5), "noise_barrier").moved(0, 0, -0.5)
        post = box_mesh((0.2, 0.28, height_m + 0.6), "steel").moved(long_m / 2, 0, -0.5)
        site.place(merge([panel, post]), pose, max(long_m - 0.2, 0.3), 0.4)
