"""What stands beside the roads: parked cars, poles, trees, clutter and buildings, drawn from the seed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.road_users import RoadUser
from advpipe.stages.simulate.world.bodies import Variant
from advpipe.stages.simulate.world.mesh import Mesh, box, ellipsoid, merge, tube
from advpipe.stages.simulate.world.roads import KERB_M, Roads

PARKED_OFFSET_M = 1.35
POLE_OFFSET_M = 2.7
WALKWAY_OFFSET_M = 3.6
TREE_OFFSET_M = (5.6, 9.0)
CLUTTER_OFFSET_M = (4.6, 9.0)
BUILDING_OFFSET_M = (9.0, 22.0)
PARKED_BODIES = ("sedan", "hatchback", "suv", "pickup", "van")
PARKED_SHARES = (0.34, 0.28, 0.26, 0.05, 0.07)


@dataclass(frozen=True)
class Plot:
    """A place beside a kerb: the kerb's point, its direction, and the side away from the road."""

    kerb_m: Float64
    yaw_rad: float

    def at(self, offset_m: float, z_m: float = 0.0, turn_rad: float = 0.0) -> Float64:
        """The pose `offset_m` outward from the kerb, looking along the road."""
        outward = np.array([np.sin(self.yaw_rad), -np.cos(self.yaw_rad), 0.0])
        return se3_from_yaw(self.kerb_m + offset_m * outward + (0, 0, z_m), self.yaw_rad + turn_rad)


class Occupied:
    """Places taken: nothing may stand on a road, nor two things on one spot."""

    def __init__(self, roads: Roads, clearance_m: float = 0.2) -> None:
        self._roads = roads.area.buffer(clearance_m)
        shapely.prepare(self._roads)
        self._cells: dict[tuple[int, int], list[shapely.Polygon]] = {}

    def take(self, map_SE3_base: Float64, length_m: float, width_m: float) -> bool:
        """Takes a rectangle if it is free."""
        corners = np.array([[x, y, 0, 1] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))], dtype=np.float64)
        footprint = shapely.Polygon(((corners * (length_m / 2, width_m / 2, 1, 1)) @ map_SE3_base.T)[:, :2])
        if self._roads.intersects(footprint):
            return False
        x_min, y_min, x_max, y_max = (int(np.floor(v / 30.0)) for v in footprint.bounds)
        cells = [(i, j) for i in range(x_min, x_max + 1) for j in range(y_min, y_max + 1)]
        if any(footprint.intersects(other) for cell in cells for other in self._cells.get(cell, ())):
            return False
        for cell in cells:
            self._cells.setdefault(cell, []).append(footprint)
        return True


def _plots(roads: Roads, per_km: float, rng: np.random.Generator) -> Iterator[Plot]:
    """Places drawn evenly along all kerbs, `per_km` of them for each kilometre."""
    for kerb in roads.kerbs_m:
        pieces = np.diff(kerb, axis=0)
        lengths = np.linalg.norm(pieces[:, :2], axis=1)
        total_m = float(lengths.sum())
        ends = np.cumsum(lengths)
        for place_m in np.sort(rng.random(rng.poisson(total_m * per_km / 1000)) * total_m):
            index = min(int(np.searchsorted(ends, place_m, side="right")), len(pieces) - 1)
            part = 1 - (ends[index] - place_m) / max(float(lengths[index]), 1e-9)
            yaw_rad = float(np.arctan2(pieces[index, 1], pieces[index, 0]))
            yield Plot(kerb[index] + part * pieces[index], yaw_rad)


def park_cars(
    scenario: Scenario,
    roads: Roads,
    variants: dict[str, Variant],
    occupied: Occupied,
    rng: np.random.Generator,
) -> list[RoadUser]:
    """Cars in bays along the kerb, a few facing the wrong way or a little askew.

    They belong to the static world and to the ground truth.
    """
    parked: list[RoadUser] = []
    for plot in _plots(roads, scenario.traffic.parked_per_km, rng):
        body = PARKED_BODIES[int(rng.choice(len(PARKED_BODIES), p=PARKED_SHARES))]
        of_body = [variant for name, variant in variants.items() if name.startswith(f"{body}.")]
        variant = of_body[int(rng.integers(len(of_body)))]
        turn_rad = np.pi * float(rng.random() < 0.15) + rng.normal(0.0, 0.03)
        pose = plot.at(PARKED_OFFSET_M + rng.normal(0, 0.08), KERB_M, turn_rad)
        if occupied.take(pose, variant.length_m + 0.6, variant.width_m + 0.1):
            parked.append(RoadUser(f"parked.{len(parked)}", variant, pose, np.zeros(3)))
    return parked


def build_scenery(scenario: Scenario, roads: Roads, occupied: Occupied, rng: np.random.Generator) -> Mesh:
    """Poles, trees, clutter and buildings."""
    environment = scenario.environment
    kinds: list[tuple[float, Callable[[np.random.Generator], _Thing]]] = [
        (environment.poles_per_km, _pole),
        (environment.trees_per_km, _tree),
        (environment.clutter_per_km, _clutter),
        (60.0 * environment.buildings, _building),
    ]
    meshes = []
    for per_km, draw in kinds:
        for plot in _plots(roads, per_km, rng):
            thing = draw(rng)
            pose = plot.at(thing.offset_m, 0.0, thing.turn_rad)
            if occupied.take(pose, thing.length_m, thing.width_m):
                meshes.append(thing.mesh.transformed(pose))
    return merge(meshes)


@dataclass(frozen=True)
class _Thing:
    mesh: Mesh
    length_m: float
    width_m: float
    offset_m: float
    turn_rad: float = 0.0


def _pole(rng: np.random.Generator) -> _Thing:
    height_m = rng.uniform(3.0, 9.0)
    parts = [tube((0, 0, -0.2), (0, 0, height_m), rng.uniform(0.04, 0.12), "steel", 8)]
    if rng.random() < 0.5:
        sign = box((0.04, rng.uniform(0.5, 0.9), rng.uniform(0.5, 0.9)), "sign")
        parts.append(sign.moved(-0.1, 0, min(height_m - 0.7, 2.2)))
    return _Thing(merge(parts), 0.6, 0.6, POLE_OFFSET_M + rng.uniform(-0.3, 0.3))


def _tree(rng: np.random.Generator) -> _Thing:
    trunk_m, crown_m = rng.uniform(1.8, 3.0), rng.uniform(1.1, 2.4)
    trunk = tube((0, 0, -0.2), (0, 0, trunk_m + crown_m / 2), rng.uniform(0.1, 0.28), "bark", 7)
    crown = ellipsoid(
        (0, 0, trunk_m + crown_m), (crown_m, crown_m, crown_m * rng.uniform(0.8, 1.3)), "foliage", 7
    )
    ragged = Mesh(
        crown.vertices_m + rng.normal(0, 0.16 * crown_m, crown.vertices_m.shape),
        crown.triangles,
        crown.materials,
    )
    return _Thing(merge([trunk, ragged]), 1.6, 1.6, rng.uniform(*TREE_OFFSET_M))


def _clutter(rng: np.random.Generator) -> _Thing:
    """Hedges, bushes, containers, cabinets, low walls: also of a car's size, to be told from cars."""
    kind = rng.integers(5)
    offset_m, turn_rad = rng.uniform(*CLUTTER_OFFSET_M), rng.normal(0, 0.15)
    if kind == 0:
        size = (rng.uniform(2.0, 9.0), rng.uniform(0.6, 1.2), rng.uniform(0.7, 1.9))
        return _Thing(box(size, "foliage"), size[0], size[1], offset_m, turn_rad)
    if kind == 1:
        radius_m = rng.uniform(0.4, 1.1)
        bush = ellipsoid((0, 0, 0.6 * radius_m), (radius_m, radius_m, radius_m), "foliage", 5)
        shaken = Mesh(
            bush.vertices_m + rng.normal(0, 0.08, bush.vertices_m.shape), bush.triangles, bush.materials
        )
        return _Thing(shaken, 2 * radius_m, 2 * radius_m, offset_m)
    if kind == 2:
        size = (rng.uniform(1.2, 4.5), rng.uniform(1.0, 1.9), rng.uniform(1.1, 1.9))
        return _Thing(box(size, "steel"), size[0], size[1], offset_m, turn_rad)
    if kind == 3:
        size = (rng.uniform(0.4, 1.2), rng.uniform(0.3, 0.6), rng.uniform(0.8, 1.6))
        return _Thing(box(size, "plastic"), size[0], size[1], offset_m, turn_rad)
    size = (rng.uniform(4.0, 15.0), 0.25, rng.uniform(0.6, 1.6))
    return _Thing(box(size, "masonry"), size[0], size[1], offset_m, turn_rad * 0.2)


def _building(rng: np.random.Generator) -> _Thing:
    length_m, depth_m, height_m = rng.uniform(8, 26), rng.uniform(7, 14), rng.uniform(3.5, 18)
    parts = [
        box((length_m, depth_m, height_m), "plaster" if rng.random() < 0.5 else "masonry").moved(0, 0, -0.3)
    ]
    for floor_m in np.arange(1.0, height_m - 1.6, 3.0):
        count = int(length_m // 3)
        for index in range(count):
            x_m = (index + 0.5) * length_m / count - length_m / 2
            window = box((1.3, depth_m + 0.06, 1.4), "glass")
            parts.append(window.moved(x_m, 0, floor_m))
    offset_m = rng.uniform(*BUILDING_OFFSET_M) + depth_m / 2
    return _Thing(merge(parts), length_m, depth_m, offset_m)
