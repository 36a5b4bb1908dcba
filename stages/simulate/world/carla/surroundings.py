"""What one vehicle's sensors measure in CARLA at one instant, and the truth about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, invert
from advpipe.pipeline.localisation.measurements import SensedMotion
from advpipe.pipeline.sensors.camera.world_pictures import Picture
from advpipe.pipeline.sensors.world import Hits, Scan
from advpipe.stages.simulate.traffic.road_users import RoadUser, boxes_of
from advpipe.stages.simulate.world.carla.lidar import Float32
from advpipe.stages.simulate.world.carla.sensors import VehicleSensors


class Shown(Protocol):
    """What CARLA shows of a drive at this instant."""

    def boxed(self, user: RoadUser) -> RoadUser | None:
        """A road user in the size that it has in CARLA; None for one that CARLA does not show."""
        ...

    def actor(self, name: str) -> int:
        """The number of a road user's actor."""
        ...

    def mirrors(self, name: str) -> bool:
        """Whether a road user is moved from outside."""
        ...

    def reported_mps(self, name: str) -> Float64:
        """The velocity (3,) that CARLA knows of a road user; 0 for one that is moved from outside."""
        ...

    def sensors(self, vehicle: str) -> VehicleSensors:
        """The sensors of an instrumented vehicle."""
        ...


class CarlaSurroundings:
    """See `Surroundings`, `ScanningSurroundings`, `PicturingSurroundings`, `RadarSurroundings` and
    `SensingSurroundings`."""

    def __init__(self, world: Shown, carrier: RoadUser, users: Sequence[RoadUser]) -> None:
        self._world, self._carrier, self._users = world, carrier, users

    def road_users(self, range_m: float) -> Boxes:
        return boxes_of(self._within(range_m))

    def cast(self, rays: Float32, range_m: float) -> Hits:
        """Raises RuntimeError: CARLA casts the rays of its own sensors only."""
        raise RuntimeError("the world carla casts no rays; it offers scans")

    def scan(self, name: str, range_m: float) -> Scan:
        boxes = self.road_users(range_m)
        sensors = self._world.sensors(self._carrier.id)
        lidar, data, truth = sensors.turn(name)
        cloud, _ = lidar.cloud(data, truth, self._world.actor(self._carrier.id))
        actors = np.array([self._world.actor(user) for user in boxes.ids], np.int64)
        map_SE3_lidar = self._carrier.map_SE3_base @ lidar.base_SE3_sensor
        occlusion = lidar.turn(truth).occlusion(boxes.transformed(invert(map_SE3_lidar)), actors)
        return Scan(cloud, occlusion, lidar.semantic(truth) if sensors.records_semantic else None)

    def picture(self, name: str, boxes: Boxes) -> Picture:
        camera, images = self._world.sensors(self._carrier.id).pictures(name)
        actors = np.array([self._world.actor(user) for user in boxes.ids], np.int64)
        return camera.picture(images, boxes, actors, self._carrier.map_SE3_base)

    def radar_hits(self, name: str, radar_mps: Float64) -> Float64:
        """See `RadarSurroundings`. CARLA takes the radar's velocity from its last step, and that of a body
        which is moved from outside as 0: SUMO's velocities count for these."""
        radar, data = self._world.sensors(self._carrier.id).scan(name)
        own, others = self._world.boxed(self._carrier), boxes_of(self._within(radar.range_m))
        pose, body = self._carrier.map_SE3_base, boxes_of([own] if own else [])
        if self._world.mirrors(self._carrier.id):
            return radar.hits(data, body, others, pose, radar_mps)
        known_mps = np.array([self._world.reported_mps(user) for user in others.ids]).reshape(-1, 3)
        lacking = replace(others, velocity_mps=others.velocity_mps - known_mps)
        return radar.hits(data, body, lacking, pose, None)

    def sensed(self) -> SensedMotion:
        return self._world.sensors(self._carrier.id).sensed()

    def _within(self, range_m: float) -> list[RoadUser]:
        """The road users within the range that CARLA shows, without the carrier, in their sizes there."""
        near = []
        for user in self._users:
            away_m = np.linalg.norm(user.position_m - self._carrier.position_m)
            if user.id != self._carrier.id and away_m <= range_m:
                near.append(self._world.boxed(user))
        return [user for user in near if user is not None]
