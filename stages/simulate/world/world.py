"""The world that the LiDAR sees: a static scene, and one of what moves, rebuilt each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.simulate.network import RoadNetwork
from advpipe.stages.simulate.road_users import RoadUser
from advpipe.stages.simulate.world.bodies import Variant
from advpipe.stages.simulate.world.mesh import Mesh, merge
from advpipe.stages.simulate.world.roads import Roads, build_roads, lay_out_roads
from advpipe.stages.simulate.world.scenery import Occupied, build_scenery, park_cars


@dataclass(frozen=True)
class Hits:
    """What R rays met first.

    range_m: (R,) float32, infinite where a ray met nothing.
    cos_incidence: (R,) float32 in [0, 1]. materials: (R,) uint8.
    transmission: (R,) float32, the two-way share of light that panes on the way left; 1 without.
    objects: (R,) int32, index into the moving road users; -1 the static world; -2 - k parked car k.
    """

    range_m: npt.NDArray[np.float32]
    cos_incidence: npt.NDArray[np.float32]
    materials: npt.NDArray[np.uint8]
    transmission: npt.NDArray[np.float32]
    objects: npt.NDArray[np.int32]


def _hits(
    range_m: npt.NDArray[np.float32],
    cos_incidence: npt.NDArray[np.float32],
    materials: npt.NDArray[np.uint8],
) -> Hits:
    count = len(range_m)
    return Hits(range_m, cos_incidence, materials, np.ones(count, np.float32), np.full(count, -1, np.int32))


class Scene:
    """One mesh, ready to be cast into."""

    def __init__(self, mesh: Mesh) -> None:
        self._materials = mesh.materials
        self._scene = o3d.t.geometry.RaycastingScene()
        if len(mesh.triangles):
            self._scene.add_triangles(
                o3d.core.Tensor(mesh.vertices_m.astype(np.float32)),
                o3d.core.Tensor(mesh.triangles.astype(np.uint32)),
            )

    def cast(self, rays: npt.NDArray[np.float32]) -> Hits:
        """Casts rays (R, 6): origin, unit direction."""
        if not len(self._materials):
            count = len(rays)
            return _hits(
                np.full(count, np.inf, np.float32), np.zeros(count, np.float32), np.zeros(count, np.uint8)
            )
        answer = self._scene.cast_rays(o3d.core.Tensor(rays))
        range_m = answer["t_hit"].numpy()
        hit = np.isfinite(range_m)
        materials = np.zeros(len(rays), np.uint8)
        materials[hit] = self._materials[answer["primitive_ids"].numpy()[hit]]
        normals = answer["primitive_normals"].numpy()
        return _hits(range_m, np.abs(np.einsum("ij,ij->i", normals, rays[:, 3:])), materials)


def nearer(a: Hits, b: Hits) -> Hits:
    """For each ray, the hit that comes first."""
    first = a.range_m <= b.range_m
    return Hits(
        np.where(first, a.range_m, b.range_m),
        np.where(first, a.cos_incidence, b.cos_incidence),
        np.where(first, a.materials, b.materials),
        np.where(first, a.transmission, b.transmission),
        np.where(first, a.objects, b.objects),
    )


class World:
    """The static world of a scenario."""

    def __init__(self, scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant]) -> None:
        seed = scenario.simulation.seed
        self.roads: Roads = lay_out_roads(network)
        occupied = Occupied(self.roads)
        parking = named_generator(seed, "world", "parked")
        self.parked: list[RoadUser] = park_cars(scenario, self.roads, variants, occupied, parking)
        ground = build_roads(network, self.roads, named_generator(seed, "world", "ground"))
        scenery = build_scenery(scenario, self.roads, occupied, named_generator(seed, "world", "scenery"))
        cars = [car.variant.mesh.transformed(car.map_SE3_base) for car in self.parked]
        self._static = Scene(merge([ground, scenery, *cars]))

    def cast(self, rays: npt.NDArray[np.float32], moving: Sequence[RoadUser]) -> Hits:
        """Casts rays (R, 6) in the map's frame into the world as it is with these road users in it."""
        bodies = merge(user.variant.mesh.transformed(user.map_SE3_base) for user in moving)
        return nearer(self._static.cast(rays), Scene(bodies).cast(rays))
