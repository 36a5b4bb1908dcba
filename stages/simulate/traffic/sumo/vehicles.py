"""The vehicles that SUMO drives, as road users of ours."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection
from advpipe.stages.simulate.traffic.sumo.pose import base_poses
from advpipe.stages.simulate.traffic.sumo.signals import lights_of
from advpipe.stages.simulate.traffic.sumo.vehicle_types import substitute_variant


class SumoVehicles:
    """Reads poses and velocities of SUMO's vehicles, and their lights if `shows_lights`."""

    def __init__(
        self,
        sumo: SumoConnection,
        network: RoadNetwork,
        variants: Mapping[str, Variant],
        seed: int,
        shows_lights: bool = False,
    ) -> None:
        self._shows_lights = shows_lights
        self._sumo, self._network, self._variants, self._seed = sumo, network, variants, seed
        self._variant_of: dict[str, Variant] = {}
        self._is_flat = all(
            np.ptp(lane.centre_m[:, 2]) == 0 for edge in network.edges.values() for lane in edge.lanes
        )

    def now(self, without: Collection[str]) -> dict[str, RoadUser]:
        """SUMO's vehicles on the road, sorted by id, `without` some; velocities point along the headings."""
        vehicle = self._sumo.vehicle
        names = [name for name in sorted(vehicle.getIDList()) if name not in without]
        if not names:
            return {}
        variants = [self._variant(name) for name in names]
        front_m = np.array([vehicle.getPosition3D(name) for name in names]) - self._network.offset_m
        angles_deg = [vehicle.getAngle(name) for name in names]
        slopes_deg = np.zeros(len(names)) if self._is_flat else [vehicle.getSlope(name) for name in names]
        speeds_mps = np.array([vehicle.getSpeed(name) for name in names])
        poses = base_poses(front_m, angles_deg, slopes_deg, [variant.length_m for variant in variants])
        velocities = poses[:, :3, 0] * speeds_mps[:, None]
        users = {
            name: RoadUser(name, variant, pose, velocity)
            for name, variant, pose, velocity in zip(names, variants, poses, velocities, strict=True)
        }
        if self._shows_lights:
            for name, user in users.items():
                users[name] = replace(user, lights=lights_of(vehicle.getSignals(name)))
        return users

    def position_m(self, name: str) -> Float64:
        """The front bumper (3,) of one vehicle, in the map's frame."""
        place: Float64 = np.array(self._sumo.vehicle.getPosition3D(name)) - self._network.offset_m
        return place

    def _variant(self, name: str) -> Variant:
        """The variant of a vehicle; a vehicle of the user's gets the size of its substitute."""
        if name not in self._variant_of:
            vehicle = self._sumo.vehicle
            variant = self._variants.get(vehicle.getTypeID(name))
            if variant is None:
                rng = named_generator(self._seed, "own traffic", name)
                variant = substitute_variant(
                    self._variants, vehicle.getVehicleClass(name), vehicle.getLength(name), rng
                )
                vehicle.setLength(name, variant.length_m)
                vehicle.setWidth(name, variant.width_m)
                vehicle.setHeight(name, variant.height_m)
            self._variant_of[name] = variant
        return self._variant_of[name]
