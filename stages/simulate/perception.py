"""What the vehicles perceive that send CPMs: the road users that a fan of rays from their roofs reaches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.simulate.detected_objects import DetectedObjects
from advpipe.stages.simulate.instrumented import Instrumented, VehicleSnapshot
from advpipe.stages.simulate.network.protocol import Network, Perceived, PerceivingNetwork
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.protocol import World

SENSOR_ABOVE_ROOF_M = 0.3
AZIMUTHS = 1440
ELEVATIONS_DEG = (-1.0, -2.5, -5.0, -10.0)
"""The rays of a fan: enough of them to reach a pedestrian at 80 m."""
FEWEST_RAYS = 2


class FleetPerception:
    """Perceives the road users around each vehicle that enough rays from its roof reach within a range.

    Walls, trees, parked cars and other road users hide what is behind them, as for a LiDAR. With
    `CpmRules.detector`, instrumented vehicles perceive what it detects in their own clouds instead.
    """

    def __init__(self, rules: CpmRules, world: World, vehicles: Sequence[Instrumented] = ()) -> None:
        self._range_m, self._world = rules.range_m, world
        self._detected: dict[str, DetectedObjects] = {}
        if rules.detector is not None:
            detector = load_detector(rules.detector)
            self._detected = {
                vehicle.name: DetectedObjects(vehicle, detector, rules.min_score) for vehicle in vehicles
            }
        self._users: list[RoadUser] = []
        azimuth_rad = np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
        elevation_rad = np.repeat(np.radians(ELEVATIONS_DEG), AZIMUTHS)
        azimuth_rad = np.tile(azimuth_rad, len(ELEVATIONS_DEG))
        level = np.cos(elevation_rad)
        self._directions: Float64 = np.column_stack(
            [level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), np.sin(elevation_rad)]
        )

    def look(
        self, users: Sequence[RoadUser], snapshots: Sequence[VehicleSnapshot] = (), now_s: float = 0.0
    ) -> None:
        """Set all moving road users of this instant, and what instrumented vehicles measure."""
        self._users = list(users)
        poses = {user.id: user.map_SE3_base for user in users}
        for snapshot in snapshots:
            if snapshot.vehicle in self._detected:
                self._detected[snapshot.vehicle].look(snapshot, poses[snapshot.vehicle], now_s)

    def perceived(self, carrier: RoadUser) -> Perceived:
        """What a vehicle perceives; parked cars are among it."""
        if carrier.id in self._detected:
            return Perceived(self._detected[carrier.id].boxes, is_exact=False)
        return Perceived(self._reached(carrier))

    def _reached(self, carrier: RoadUser) -> Boxes:
        """The road users that rays reach, in the map's frame."""
        around = self._world.around(carrier, self._users)
        boxes = around.road_users(self._range_m)
        if not len(boxes):
            return boxes
        pose, height_m = carrier.map_SE3_base, carrier.variant.height_m + SENSOR_ABOVE_ROOF_M
        rays = np.empty((len(self._directions), 6), np.float32)
        rays[:, :3] = pose[:3, 3] + pose[:3, 2] * height_m
        rays[:, 3:] = self._directions @ pose[:3, :3].T
        hits = around.cast(rays, self._range_m)
        reached = hits.objects[(hits.objects >= 0) & (hits.range_m <= self._range_m)]
        return boxes[np.flatnonzero(np.bincount(reached, minlength=len(boxes)) >= FEWEST_RAYS)]


def fleet_perception(
    v2x: V2x, world: World, network: Network, vehicles: Sequence[Instrumented]
) -> FleetPerception | None:
    """The perception of the stations that send CPMs, which `network` asks; None where there are none.

    Raises UsageError for a world or network that cannot have one.
    """
    if not v2x.enabled or v2x.cpm is None:
        return None
    if not {"road users", "rays"} <= world.offers:
        raise UsageError(
            "v2x.cpm needs a world in which rays meet road users, and an instrumented vehicle; leave it out, "
            "or add a vehicle"
        )
    if not isinstance(network, PerceivingNetwork):
        raise UsageError(
            f"v2x.cpm needs a network with set_perception (stages/simulate/network/protocol.py), which "
            f"{v2x.network} has not; leave it out"
        )
    sight = FleetPerception(v2x.cpm, world, vehicles)
    network.set_perception(sight.perceived)
    return sight
