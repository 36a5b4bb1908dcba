"""A world for ray casting: a static scene, and the road users in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt
import shapely

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import Boxes, joined_boxes
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.camera.surfaces import Surfaces
from advpipe.pipeline.sensors.world import Hits, Offer
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.road_network.roads import Roads, lay_out_roads
from advpipe.stages.simulate.traffic.road_users import RoadUser, boxes_of
from advpipe.stages.simulate.world.raycast.barriers import build_barriers
from advpipe.stages.simulate.world.raycast.body_look import BodyLook
from advpipe.stages.simulate.world.raycast.body_meshes import body_meshes
from advpipe.stages.simulate.world.raycast.ground import build_ground
from advpipe.stages.simulate.world.raycast.instanced_bodies import CandidateHits, InstancedBodies
from advpipe.stages.simulate.world.raycast.markings import build_markings
from advpipe.stages.simulate.world.raycast.mesh import merge
from advpipe.stages.simulate.world.raycast.occupied import Occupied, walkways
from advpipe.stages.simulate.world.raycast.parking import park_cars
from advpipe.stages.simulate.world.raycast.placed_users import PlacedUsers
from advpipe.stages.simulate.world.raycast.scene import Float32, MaterialHits, Returns, Scene
from advpipe.stages.simulate.world.raycast.scenery import build_scenery
from advpipe.stages.simulate.world.raycast.static_look import StaticLook
from advpipe.stages.simulate.world.raycast.surface_detail import DetailMap
from advpipe.stages.simulate.world.raycast.terrain import Terrain
from advpipe.stages.simulate.world.raycast.view import Viewer, moved_on

NEAR_M = 10.0
"""Margin on the range of parked cars, whose bodies extend beyond their position."""


class RaycastWorld:
    """See `World`: the static world of a scenario, and the bodies of all possible road users.

    parked: cars that never move. Raises AdvpipeError for an unusable mesh of the user.
    """

    def __init__(self, scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant]) -> None:
        seed = scenario.simulation.seed
        self.offers: frozenset[Offer] = frozenset({"road users", "rays", "surfaces"})
        self.roads: Roads = lay_out_roads(network)
        occupied = Occupied(self.roads, free=walkways(self.roads))

        def generator(use: str) -> np.random.Generator:
            return named_generator(seed, "world", use)

        self.parked: list[RoadUser] = park_cars(scenario, self.roads, variants, occupied, generator("parked"))
        terrain = Terrain(self.roads, scenario.environment.slopes, generator("terrain"))
        scenery, footprints = build_scenery(scenario, network, self.roads, terrain, occupied, generator)
        self.footprints: list[shapely.Polygon] = footprints
        static = [
            build_ground(network, self.roads, terrain, generator("ground")),
            *build_markings(network, generator("markings")),
            scenery,
            *build_barriers(scenario.environment.barriers, self.roads, occupied, generator("barriers")),
        ]
        ground = merge(static)
        self._static = Scene(ground)
        self._detail = DetailMap(generator("detail").random(2) * 40.0)
        meshes = body_meshes(variants, scenario.bodies)
        self._bodies = InstancedBodies(variants, meshes)
        self.parked_boxes = boxes_of(self.parked)
        self._make_look = partial(StaticLook, ground, footprints, generator("look"))
        self._make_body_look = partial(BodyLook, [meshes[name] for name in variants])
        self._parked_m = np.array([car.position_m for car in self.parked]).reshape(-1, 3)

    def around(self, carrier: RoadUser, users: Sequence[RoadUser]) -> RaycastSurroundings:
        return RaycastSurroundings(self, carrier, users)

    @cached_property
    def viewer(self) -> Viewer:
        """What cameras see."""
        return Viewer(self._static, self._make_look(), self._bodies, self._make_body_look())

    def prepare(self) -> None:
        """Do what the first cast would have to do before."""
        self._static.prepare()
        self._bodies.prepare()

    def cast(self, rays: Float32, users: Sequence[RoadUser], range_m: float = np.inf) -> MaterialHits:
        """Cast rays (R, 6) in the map's frame into the static world with these road users.

        The rays start near one another, as those of one revolution of a sensor do. Parked cars farther away
        than `range_m` are left out.
        """
        static = self._static.returns(rays)
        away_m = np.linalg.norm(self._parked_m - rays[0, :3], axis=1)
        near = np.flatnonzero(away_m <= range_m + NEAR_M)
        ids = np.concatenate([np.arange(len(users)), -2 - near]).astype(np.int32)
        road_users = [*users, *(self.parked[index] for index in near)]
        occlusion = np.zeros(len(users) + len(self.parked), np.float32)
        candidates = self._bodies.candidate_hits(rays, road_users)
        hits = replace(_merged(static, candidates, ids, occlusion), origins=(rays, self._detail))
        hit = np.isfinite(candidates.returns.range_m)
        alone = np.bincount(candidates.users[hit], minlength=len(road_users))
        seen = candidates.returns.range_m == hits.range_m[candidates.rays]
        visible = np.bincount(candidates.users[hit & seen], minlength=len(road_users))
        slots = np.concatenate([np.arange(len(users)), len(users) + near])
        occlusion[slots] = np.where(alone > 0, 1 - visible / np.maximum(alone, 1), 0.0)
        return hits

    def cast_body(self, rays: Float32, user: RoadUser) -> MaterialHits:
        """Cast rays (R, 6) in the user's base_link into its body alone."""
        alone = self._bodies.candidate_hits(rays, [replace(user, map_SE3_base=np.eye(4))])
        range_m, cos = np.full(len(rays), np.inf, np.float32), np.zeros(len(rays), np.float32)
        materials, transmission = np.zeros(len(rays), np.uint8), np.ones(len(rays), np.float32)
        range_m[alone.rays] = alone.returns.range_m
        cos[alone.rays], materials[alone.rays] = alone.returns.cos_incidence, alone.returns.materials
        alone.returns.panes.attenuate(range_m, transmission, alone.rays)
        returns = Returns(range_m, cos, materials, alone.returns.panes)
        objects = np.full(len(rays), -1, np.int32)
        hits = MaterialHits.of(returns, range_m, transmission, objects, np.zeros(0, np.float32))
        return replace(hits, origins=(rays, self._detail))


class RaycastSurroundings:
    """See `Surroundings`: the world around one vehicle, with these road users."""

    def __init__(self, world: RaycastWorld, carrier: RoadUser, users: Sequence[RoadUser]) -> None:
        self._world, self._carrier, self._users = world, carrier, users
        self._near: dict[float, tuple[list[RoadUser], npt.NDArray[np.int64]]] = {}
        self._placed: dict[tuple[float, float, bool], PlacedUsers] = {}

    def road_users(self, range_m: float) -> Boxes:
        moving, parked = self._within(range_m)
        return joined_boxes(boxes_of(moving), self._world.parked_boxes[parked])

    def cast(self, rays: Float32, range_m: float) -> Hits:
        moving, parked = self._within(range_m)
        hits = self._world.cast(rays, moving, range_m)
        slots = np.concatenate([np.arange(len(moving)), len(moving) + parked])
        # place[2 + k] is the index of parked car k among the road users; -1 beyond the range.
        place = np.full(2 + len(self._world.parked), -1, np.int32)
        place[2 + parked] = len(moving) + np.arange(len(parked))
        objects = np.where(hits.objects < -1, place[np.maximum(-hits.objects, 0)], hits.objects)
        return replace(hits, objects=objects, occlusion=hits.occlusion[slots])

    def cast_own_body(self, rays: Float32) -> Hits:
        return self._world.cast_body(rays, self._carrier)

    def surfaces(self, rays: Float32, range_m: float, pixel_rad: float, time_s: float = 0.0) -> Surfaces:
        return self._world.viewer.surfaces(rays, self._near_users(range_m, time_s), pixel_rad)

    def is_shaded(self, points_m: Float32, sun: Float32, range_m: float) -> npt.NDArray[np.bool_]:
        return self._world.viewer.is_shaded(points_m, sun, self._near_users(range_m, with_carrier=True))

    def _near_users(self, range_m: float, time_s: float = 0.0, with_carrier: bool = False) -> PlacedUsers:
        key = range_m, time_s, with_carrier
        if key not in self._placed:
            moving, parked = self._within(range_m)
            users = [*moving, *(self._world.parked[index] for index in parked)]
            users += [self._carrier] if with_carrier else []
            self._placed[key] = self._world.viewer.placed(moved_on(users, time_s) if time_s else users)
        return self._placed[key]

    def _within(self, range_m: float) -> tuple[list[RoadUser], npt.NDArray[np.int64]]:
        """The moving road users within the range, and the indices of the parked cars within it."""
        if range_m not in self._near:
            moving = [self._users[index] for index in within(self._users, self._carrier, range_m)]
            self._near[range_m] = moving, within(self._world.parked, self._carrier, range_m)
        return self._near[range_m]


def within(users: Sequence[RoadUser], carrier: RoadUser, range_m: float) -> npt.NDArray[np.int64]:
    """Indices (K,) of the users within `range_m` of the carrier, without the carrier itself."""
    places = np.array([user.position_m for user in users]).reshape(-1, 3)
    near = np.linalg.norm(places - carrier.position_m, axis=1) <= range_m
    near &= np.array([user.id != carrier.id for user in users], dtype=bool)
    return np.flatnonzero(near)


def _merged(
    static: Returns, candidates: CandidateHits, ids: npt.NDArray[np.int32], occlusion: Float32
) -> MaterialHits:
    """The nearest return of each ray, attenuated by the panes before it."""
    returns, rays = candidates.returns, candidates.rays
    range_m, cos, materials = static.range_m.copy(), static.cos_incidence, static.materials
    np.minimum.at(range_m, rays, returns.range_m)
    first = np.flatnonzero((returns.range_m == range_m[rays]) & (returns.range_m < static.range_m[rays]))
    objects = np.full(len(range_m), -1, np.int32)
    objects[rays[first]] = ids[candidates.users[first]]
    cos[rays[first]] = returns.cos_incidence[first]
    materials[rays[first]] = returns.materials[first]
    transmission = np.ones(len(range_m), np.float32)
    static.panes.attenuate(range_m, transmission)
    returns.panes.attenuate(range_m, transmission, rays)
    return MaterialHits.of(static, range_m, transmission, objects, occlusion)
