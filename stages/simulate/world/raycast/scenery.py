"""Roadside scenery drawn from the seed: parked cars, street furniture, trees and buildings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.scenario.environment import UserObject
from advpipe.pipeline.scenario.fleet import CAR_SHARES
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant, variants_of
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import KERB_M, WALKWAY_OFFSET_M, Roads
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast import furniture, trees
from advpipe.stages.simulate.world.raycast.buildings import building
from advpipe.stages.simulate.world.raycast.ground import terrain_at
from advpipe.stages.simulate.world.raycast.markings import has_signal
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.occupied import Occupied, footprint
from advpipe.stages.simulate.world.raycast.user_mesh import load_mesh

PARKED_OFFSET_M = (1.0, 1.6)
"""Where the middle of a parked car may stand, from the kerb: on the edge of the pavement, or away from it."""

ASKEW_SHARE, ASKEW_RAD = 0.15, np.deg2rad(12.0)
"""Share of the parked cars that stand askew, and by how much at most: more would reach into the walkway."""

POLE_OFFSET_M = 2.7
BESIDE_WALKWAY_M = (5.3, 9.0)
TREE_OFFSET_M = (5.8, 9.5)
BUILDING_OFFSET_M = (8.0, 20.0)
BUILDING_PLOTS_PER_KM = 60.0
FAR_OFFSET_M = (6.0, 25.0)
PARKED_VANS = 0.06
"""Share of vans among parked vehicles; the others are cars, in the shares of the fleet."""

PARKED = {body: (1 - PARKED_VANS) * share for body, share in CAR_SHARES.items()} | {"van": PARKED_VANS}


@dataclass(frozen=True)
class Plot:
    """A place beside a kerb: the kerb's point, its direction, and the side away from the road."""

    kerb_m: Float64
    yaw_rad: float

    def at(self, offset_m: float, z_m: float = 0.0, turn_rad: float = 0.0, pitch_rad: float = 0.0) -> Float64:
        """The pose (4, 4), heading along the road, `offset_m` outward from the kerb."""
        outward = np.array([np.sin(self.yaw_rad), -np.cos(self.yaw_rad), 0.0])
        return se3_from_yaw(
            self.kerb_m + offset_m * outward + (0, 0, z_m), self.yaw_rad + turn_rad, pitch_rad
        )


@dataclass(frozen=True)
class _RoadsideObject:
    """A mesh in the frame of its plot, the ground area that it occupies, and its distance to the kerb."""

    mesh: Mesh
    length_m: float
    width_m: float
    offset_m: float
    turn_rad: float = 0.0


Draw = Callable[[np.random.Generator], _RoadsideObject]


def _plots(
    lines: tuple[Float64, ...], per_km: float, rng: np.random.Generator
) -> Iterator[tuple[Plot, float]]:
    """Places drawn evenly along kerbs, `per_km` of them for each kilometre, and the slope there."""
    for kerb in lines:
        pieces = np.diff(kerb, axis=0)
        lengths = np.linalg.norm(pieces[:, :2], axis=1)
        total_m = float(lengths.sum())
        ends = np.cumsum(lengths)
        for place_m in np.sort(rng.random(rng.poisson(total_m * per_km / 1000)) * total_m):
            index = min(int(np.searchsorted(ends, place_m, side="right")), len(pieces) - 1)
            long_m = max(float(lengths[index]), 1e-9)
            part = 1 - (ends[index] - place_m) / long_m
            yaw_rad = float(np.arctan2(pieces[index, 1], pieces[index, 0]))
            yield Plot(kerb[index] + part * pieces[index], yaw_rad), float(pieces[index, 2] / long_m)


def park_cars(
    scenario: Scenario,
    roads: Roads,
    variants: dict[str, Variant],
    occupied: Occupied,
    rng: np.random.Generator,
) -> list[RoadUser]:
    """Cars in bays along the kerb, a few facing the wrong way or a little askew.

    They never move, and are part of the ground truth.
    """
    parked: list[RoadUser] = []
    for plot, slope in _plots(roads.kerbs_m, scenario.traffic.parked_per_km, rng):
        body = list(PARKED)[int(rng.choice(len(PARKED), p=list(PARKED.values())))]
        of_body = variants_of(variants, body)
        variant = variants[of_body[int(rng.integers(len(of_body)))]]
        turned = rng.random() < 0.15
        askew_rad = ASKEW_RAD if rng.random() < ASKEW_SHARE else 0.0
        turn_rad = np.pi * float(turned) + rng.normal(0.0, 0.03) + rng.uniform(-1, 1) * askew_rad
        pitch_rad = float(np.arctan(slope)) * (1 if turned else -1)
        pose = plot.at(rng.uniform(*PARKED_OFFSET_M), KERB_M, turn_rad, pitch_rad)
        if occupied.take(pose, variant.length_m + 0.6, variant.width_m + 0.1):
            parked.append(RoadUser(f"parked.{len(parked)}", variant, pose, np.zeros(3)))
    return parked


def build_scenery(
    scenario: Scenario, network: RoadNetwork, roads: Roads, occupied: Occupied, rng: np.random.Generator
) -> tuple[Mesh, list[shapely.Polygon]]:
    """Street furniture, trees, buildings and the user's objects as one mesh; footprints of the buildings.

    Raises AdvpipeError for an unusable mesh of the user.
    """
    environment = scenario.environment
    streets: list[tuple[float, Draw]] = [
        (0.55 * environment.poles_per_km, _lamp_post),
        (0.45 * environment.poles_per_km, _sign),
        (environment.trees_per_km, _tree),
        (environment.clutter_per_km, _clutter),
        (BUILDING_PLOTS_PER_KM * environment.buildings, _building),
    ]
    fast: list[tuple[float, Draw]] = [
        (environment.poles_per_km, _roadside_post),
        (1.5 * environment.trees_per_km, _far_tree),
    ]
    meshes = [_object(index, given, roads) for index, given in enumerate(environment.objects)]
    meshes += _signals(network, occupied, rng)
    footprints: list[shapely.Polygon] = []
    for lines, densities in ((roads.kerbs_m, streets), (roads.verges_m, fast)):
        for per_km, draw in densities:
            for plot, _ in _plots(lines, per_km, rng):
                item = draw(rng)
                pose = plot.at(item.offset_m, 0.0, item.turn_rad)
                if item.offset_m > WALKWAY_OFFSET_M and not roads.is_flat:
                    pose[2, 3] = terrain_at(pose[None, :2, 3], roads)[0]
                elif item.offset_m < BESIDE_WALKWAY_M[0] and lines is roads.kerbs_m:
                    pose[2, 3] += KERB_M
                if occupied.take(pose, item.length_m, item.width_m):
                    meshes.append(item.mesh.transformed(pose))
                    if draw is _building:
                        footprints.append(footprint(pose, item.length_m, item.width_m))
    return merge(meshes), footprints


def _object(index: int, given: UserObject, roads: Roads) -> Mesh:
    mesh = load_mesh(given.mesh, f"environment.objects.{index}", given.material, given.scale)
    ground_m = float(terrain_at(np.array([[given.x_m, given.y_m]]), roads)[0])
    return mesh.transformed(se3_from_yaw((given.x_m, given.y_m, ground_m + given.z_m), given.yaw_rad))


def _signals(network: RoadNetwork, occupied: Occupied, rng: np.random.Generator) -> list[Mesh]:
    """A signal to the right of every stop line."""
    meshes = []
    for edge in filter(has_signal, network.drivable):
        lane = edge.lanes[0]
        step = lane.centre_m[-1] - lane.centre_m[-2]
        plot = Plot(lane.centre_m[-1], float(np.arctan2(step[1], step[0])))
        for aside_m in (0.7, 1.4, 2.4):
            pose = plot.at(lane.width_m / 2 + aside_m, KERB_M)
            if occupied.take(pose, 0.4, 0.4):
                meshes.append(furniture.traffic_light(rng).transformed(pose))
                break
    return meshes


def _lamp_post(rng: np.random.Generator) -> _RoadsideObject:
    return _RoadsideObject(furniture.lamp_post(rng), 0.6, 0.6, POLE_OFFSET_M + rng.uniform(-0.1, 0.1))


def _sign(rng: np.random.Generator) -> _RoadsideObject:
    if rng.random() < 0.15:
        return _RoadsideObject(furniture.bollard(rng), 0.3, 0.3, 0.5)
    return _RoadsideObject(furniture.traffic_sign(rng), 0.6, 1.0, POLE_OFFSET_M, rng.normal(0.0, 0.08))


def _roadside_post(rng: np.random.Generator) -> _RoadsideObject:
    if rng.random() < 0.6:
        return _RoadsideObject(furniture.delineator(rng), 0.2, 0.2, 1.4)
    return _RoadsideObject(furniture.traffic_sign(rng), 0.6, 1.8, 2.6, rng.normal(0.0, 0.05))


def _tree(rng: np.random.Generator) -> _RoadsideObject:
    build = (trees.round_tree, trees.round_tree, trees.conifer, trees.columnar_tree)[int(rng.integers(4))]
    return _RoadsideObject(build(rng), 1.6, 1.6, rng.uniform(*TREE_OFFSET_M))


def _far_tree(rng: np.random.Generator) -> _RoadsideObject:
    item = _tree(rng) if rng.random() < 0.6 else _RoadsideObject(trees.bush(rng), 1.5, 1.5, 0.0)
    return _RoadsideObject(item.mesh, item.length_m, item.width_m, rng.uniform(*FAR_OFFSET_M))


def _clutter(rng: np.random.Generator) -> _RoadsideObject:
    """Hedges, bushes, fences, walls, bins, containers and shelters behind the walkway."""
    choice = int(rng.choice(7, p=(0.2, 0.2, 0.15, 0.12, 0.13, 0.15, 0.05)))
    offset_m, turn_rad = rng.uniform(*BESIDE_WALKWAY_M), rng.normal(0, 0.15)
    long_m = rng.uniform(3.0, 14.0)
    if choice == 0:
        width_m, long_m = rng.uniform(0.6, 1.1), min(long_m, 6.0)
        mesh = trees.hedge(long_m, width_m, rng.uniform(0.8, 1.9), rng)
        return _RoadsideObject(mesh, long_m, width_m, offset_m, 0.2 * turn_rad)
    if choice == 1:
        return _RoadsideObject(trees.bush(rng), 2.0, 2.0, offset_m)
    if choice == 2:
        return _RoadsideObject(furniture.fence(long_m, rng), long_m, 0.3, offset_m, 0.2 * turn_rad)
    if choice == 3:
        mesh = box_mesh((long_m, 0.25, rng.uniform(0.6, 1.6)), "masonry")
        return _RoadsideObject(mesh, long_m, 0.25, offset_m, 0.2 * turn_rad)
    if choice == 4:
        return _RoadsideObject(furniture.litter_bin(rng), 1.3, 0.8, offset_m, turn_rad)
    if choice == 5:
        mesh = furniture.container(rng)
        size = np.ptp(mesh.vertices_m, axis=0)
        return _RoadsideObject(mesh, float(size[0]), float(size[1]), offset_m, turn_rad)
    return _RoadsideObject(furniture.shelter(rng), 4.0, 1.8, offset_m + 0.5)


def _building(rng: np.random.Generator) -> _RoadsideObject:
    length_m, depth_m = rng.uniform(8, 26), rng.uniform(8, 14)
    storeys = int(rng.choice([1, 2, 3, 4, 5, 7], p=(0.15, 0.3, 0.2, 0.15, 0.15, 0.05)))
    offset_m = rng.uniform(*BUILDING_OFFSET_M) + depth_m / 2
    return _RoadsideObject(building(length_m, depth_m, storeys, rng), length_m, depth_m, offset_m)
