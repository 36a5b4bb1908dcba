"""What the sensors of vehicles perceive that send CPMs: the road users that a fan of rays reaches."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.protocol import World

SENSOR_ABOVE_ROOF_M = 0.3
AZIMUTHS = 1440
ELEVATIONS_DEG = (-1.0, -2.5, -5.0, -10.0)
"""The rays of a fan: enough of them to reach a pedestrian at 80 m."""
FEWEST_RAYS = 2


class FanPerception:
    """Perceives the road users around a vehicle that `FEWEST_RAYS` rays from its roof reach within a range.

    Walls, trees, parked cars and other road users hide what is behind them, as for a LiDAR.
    """

    def __init__(self, rules: CpmRules, world: World) -> None:
        if {"road users", "rays"} - world.offers:
            raise UsageError(
                "v2x.cpm needs a world with road users and rays, and a vehicle with sensors in it; leave it "
                "out, or take world: raycast"
            )
        self._range_m, self._world = rules.range_m, world
        azimuth_rad = np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
        elevation_rad = np.radians(ELEVATIONS_DEG)[:, None]
        self._directions: Float64 = np.stack(
            [
                np.cos(elevation_rad) * np.cos(azimuth_rad),
                np.cos(elevation_rad) * np.sin(azimuth_rad),
                np.broadcast_to(np.sin(elevation_rad), (len(ELEVATIONS_DEG), AZIMUTHS)),
            ],
            axis=-1,
        ).reshape(-1, 3)

    def perceived(self, carrier: RoadUser, users: list[RoadUser]) -> Boxes:
        """The road users that a vehicle perceives, in the map's frame; parked cars are among them."""
        around = self._world.around(carrier, users)
        boxes = around.road_users(self._range_m)
        if not len(boxes):
            return boxes
        pose, height_m = carrier.map_SE3_base, carrier.variant.height_m + SENSOR_ABOVE_ROOF_M
        origin_m = pose[:3, 3] + pose[:3, 2] * height_m
        rays = np.empty((len(self._directions), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origin_m, self._directions @ pose[:3, :3].T
        hits = around.cast(rays, self._range_m)
        reached = hits.objects[(hits.objects >= 0) & (hits.range_m <= self._range_m)]
        counts = np.bincount(reached, minlength=len(boxes))
        return boxes[np.flatnonzero(counts >= FEWEST_RAYS)]
