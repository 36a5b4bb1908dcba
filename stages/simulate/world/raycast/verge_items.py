"""What stands between kerb and walkway, among the parked cars: lamps, signs, trees, furniture, beds."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.environment import Environment
from advpipe.stages.simulate.road_network.roads import KERB_M
from advpipe.stages.simulate.world.raycast import furniture
from advpipe.stages.simulate.world.raycast.leaves import hedge
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.occupied import WALKWAY_M
from advpipe.stages.simulate.world.raycast.plots import plots_along
from advpipe.stages.simulate.world.raycast.site import Site
from advpipe.stages.simulate.world.raycast.templates import STREET_SHARES, Plants

NEAREST_M = 0.4
"""Nothing but bollards stands nearer to the kerb."""

VERGE_M = 2.72
"""Where lamps and trees stand: between the bays and the walkway."""


class Item(NamedTuple):
    """A mesh that takes a rectangle along the kerb, `offset_m` from it."""

    mesh: Mesh
    length_m: float
    width_m: float
    offset_m: float
    turn_rad: float = 0.0


Draw = Callable[[np.random.Generator], Item]


def build_verges(
    site: Site,
    kerbs_m: tuple[Float64, ...],
    environment: Environment,
    plants: Plants,
    rng: np.random.Generator,
) -> None:
    """Furniture along streets, drawn evenly along their kerbs."""

    def street_tree(rng: np.random.Generator) -> Item:
        return Item(plants.tree(rng, STREET_SHARES), 0.5, 0.5, VERGE_M)

    def bed(rng: np.random.Generator) -> Item:
        return _bed(plants, rng)

    densities: list[tuple[float, Draw]] = [
        (0.55 * environment.poles_per_km, _lamp_post),
        (0.45 * environment.poles_per_km, _sign),
        (0.6 * environment.trees_per_km, street_tree),
        (environment.clutter_per_km, _clutter),
        (0.35 * environment.bushes_per_km, bed),
    ]
    for per_km, draw in densities:
        for plot, slope in plots_along(kerbs_m, per_km, rng):
            item = draw(rng)
            pitch_rad = -float(np.arctan(slope)) if item.length_m > 1.5 else 0.0
            pose = plot.at(item.offset_m, KERB_M, item.turn_rad, pitch_rad)
            site.place(item.mesh, pose, item.length_m, item.width_m)


def _lamp_post(rng: np.random.Generator) -> Item:
    return Item(furniture.lamp_post(rng), 0.5, 0.45, VERGE_M + rng.uniform(-0.08, 0.08))


def _sign(rng: np.random.Generator) -> Item:
    if rng.random() < 0.15:
        return Item(furniture.bollard(rng), 0.3, 0.3, 0.5)
    mesh = furniture.traffic_sign(rng)
    foot = mesh.vertices_m[mesh.vertices_m[:, 2] < 0, 1]
    width_m = float(np.ptp(foot)) + 0.15
    return Item(mesh, 0.4, width_m, WALKWAY_M[0] - 0.05 - width_m / 2, rng.normal(0.0, 0.05))


def _clutter(rng: np.random.Generator) -> Item:
    """Bins, cabinets, skips, benches, bicycle stands, shelters, and holes in the ground."""
    choice = int(rng.choice(6, p=(0.22, 0.24, 0.16, 0.2, 0.06, 0.12)))
    turn_rad = rng.normal(0, 0.06)
    if choice == 0:
        return Item(furniture.litter_bin(rng), 1.3, 0.8, rng.uniform(1.2, 2.4), turn_rad)
    if choice == 1:
        mesh = furniture.container(rng)
        length_m, width_m, _ = np.ptp(mesh.vertices_m, axis=0).tolist()
        return Item(mesh, length_m, width_m, 2.8 - width_m / 2 - 0.1, turn_rad)
    if choice == 2:
        return Item(furniture.bench(rng), 1.7, 0.6, 2.4, np.pi + turn_rad)
    if choice == 3:
        return Item(furniture.bicycle_stand(rng), 4.0, 1.5, 1.5)
    if choice == 4:
        return Item(furniture.shelter(rng), 4.0, 1.8, 2.0)
    return Item(furniture.construction_barrier(rng), 4.3, 2.0, 1.6)


def _bed(plants: Plants, rng: np.random.Generator) -> Item:
    """A bed between bays: a kerb around soil, with low bushes, a clipped hedge or tall grass."""
    length_m, width_m = rng.uniform(2.0, 6.0), rng.uniform(1.2, 1.7)
    parts = [box_mesh((length_m, width_m, 0.12), "kerbstone", "soil")]
    if rng.random() < 0.35:
        parts.append(hedge(length_m - 0.3, width_m - 0.4, rng.uniform(0.5, 0.9), rng))
    else:
        for x in np.arange(-length_m / 2 + 0.5, length_m / 2 - 0.4, 0.8):
            plant = plants.bush(rng) if rng.random() < 0.6 else plants.tall_grass(rng)
            reach_m = np.abs(plant.vertices_m[:, :2]).max()
            parts.append(
                plant.scaled(*[min(1.0, 0.5 / reach_m)] * 3).moved(float(x), rng.normal(0, 0.1), 0.1)
            )
    return Item(merge(parts), length_m, width_m, NEAREST_M + 0.1 + width_m / 2)
