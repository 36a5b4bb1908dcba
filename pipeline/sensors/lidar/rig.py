"""The LiDARs of one instrumented vehicle, and their measurements in one step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import Boxes, count_points
from advpipe.pipeline.geometry.transforms import Float64, invert
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.sensors.lidar.lidar import Lidar
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.sensor import DriveSettings, Instant
from advpipe.pipeline.sensors.world import CarrierSurroundings, ScanningSurroundings


@dataclass(frozen=True)
class LidarView:
    """The measurements of a vehicle's LiDARs in one step, and the ground truth of M road users in range.

    clouds: by LiDAR. boxes: in the map frame. lidar_points: (M,) int64, number of points on each, in all
    clouds. occlusion: (M,) in [0, 1], for the LiDAR with the best view. semantic: by LiDAR, see `Scan`.
    """

    clouds: Mapping[str, Cloud]
    boxes: Boxes
    lidar_points: npt.NDArray[np.int64]
    occlusion: Float64
    semantic: Mapping[str, Cloud]


class LidarRig:
    """The LiDARs of one vehicle, by name."""

    def __init__(self, vehicle: str, sections: Mapping[str, LidarSensor], drive: DriveSettings) -> None:
        self._vehicle, self._seed = vehicle, drive.seed
        self.lidars = {
            name: Lidar(
                section,
                drive.step_s,
                drive.weather,
                named_generator(drive.seed, "lidar calibration", vehicle, name),
            )
            for name, section in sections.items()
        }
        self._is_mounted = False
        self._range_m = max((section.range for section in sections.values()), default=0.0)

    def look(self, instant: Instant) -> LidarView | None:
        """The view of the LiDARs whose turn ends at this instant; None if there is no such LiDAR."""
        due = {name: lidar for name, lidar in self.lidars.items() if lidar.is_due(instant.frame)}
        if not due:
            return None
        motion, world = instant.motion, instant.world
        if not self._is_mounted and isinstance(world, CarrierSurroundings):
            for lidar in self.lidars.values():
                lidar.mount_on(world)
        self._is_mounted = True
        boxes = world.road_users(self._range_m)
        twist = np.concatenate([motion.base_velocity_mps, motion.turn_rate_radps])
        clouds: dict[str, Cloud] = {}
        semantic: dict[str, Cloud] = {}
        points, occlusion = np.zeros(len(boxes.ids), np.int64), np.ones(len(boxes.ids))
        for name, lidar in due.items():
            map_SE3_lidar = motion.map_SE3_base @ lidar.base_SE3_lidar
            if isinstance(world, ScanningSurroundings):
                scan = world.scan(name, self._range_m)
                clouds[name], hidden = scan.cloud, scan.occlusion
                if scan.semantic is not None:
                    semantic[name] = scan.semantic
            else:
                hits = world.cast(lidar.rays(motion.map_SE3_base, twist), self._range_m)
                rng = named_generator(self._seed, "lidar", self._vehicle, name, instant.frame)
                clouds[name] = lidar.measure(hits, rng, boxes.velocity_mps @ map_SE3_lidar[:3, :3])
                hidden = hits.occlusion
            in_lidar = boxes.transformed(invert(map_SE3_lidar))
            points += count_points(lidar.undistorted(clouds[name], twist), in_lidar.geometry)
            occlusion = np.minimum(occlusion, hidden)
        return LidarView(clouds, boxes, points, occlusion, semantic)
