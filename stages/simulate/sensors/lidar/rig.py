"""The LiDARs of one instrumented vehicle, and what they see in one step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import Boxes, count_points
from advpipe.pipeline.geometry.transforms import Float64, invert
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.sensors.lidar import Lidar
from advpipe.stages.simulate.traffic.road_users import RoadUser, boxes_of
from advpipe.stages.simulate.world.raycast.world import World


@dataclass(frozen=True)
class View:
    """What the LiDARs of a vehicle saw: `clouds` by LiDAR, and the truth about M road users in range.

    boxes: in the map's frame. lidar_points: (M,) int64, returns on each, of all clouds. occlusion: (M,) in
    [0, 1], for the LiDAR that sees it best.
    """

    clouds: Mapping[str, Cloud]
    boxes: Boxes
    lidar_points: npt.NDArray[np.int64]
    occlusion: Float64


class Rig:
    """The LiDARs of one vehicle, by name."""

    def __init__(self, scenario: Scenario, vehicle: str) -> None:
        self.vehicle = vehicle
        self._scenario = scenario
        sensors = {name: s for name, s in scenario.sensors.lidars.items() if s.vehicle == vehicle}
        step_s, weather = scenario.simulation.step_s, scenario.environment.weather
        self.lidars = {name: Lidar(sensor, step_s, weather) for name, sensor in sensors.items()}
        self.range_m = max((sensor.range for sensor in sensors.values()), default=0.0)

    def look(
        self, world: World, users: Sequence[RoadUser], carrier: RoadUser, motion: MotionStep, frame: int
    ) -> View | None:
        """Turns those LiDARs whose turn ends at this frame; None where there is none."""
        due = {name: lidar for name, lidar in self.lidars.items() if lidar.is_due(frame)}
        if not due:
            return None
        others = [users[index] for index in within(users, carrier, self.range_m)]
        parked = within(world.parked, carrier, self.range_m)
        boxes = boxes_of([*others, *(world.parked[index] for index in parked)])
        slots = np.concatenate([np.arange(len(others)), len(others) + parked])
        velocities_mps = np.array([user.velocity_mps for user in others]).reshape(-1, 3)
        twist = np.concatenate([motion.base_velocity_mps, motion.turn_rate_radps])
        clouds: dict[str, Cloud] = {}
        points, occlusion = np.zeros(len(slots), np.int64), np.ones(len(slots))
        for name, lidar in due.items():
            hits = world.cast(lidar.rays(carrier.map_SE3_base, twist), others, self.range_m)
            map_SE3_lidar = carrier.map_SE3_base @ lidar.base_SE3_lidar
            rng = named_generator(self._scenario.simulation.seed, "lidar", self.vehicle, name, frame)
            clouds[name] = lidar.measure(hits, rng, velocities_mps @ map_SE3_lidar[:3, :3])
            in_lidar = boxes.transformed(invert(map_SE3_lidar))
            points += count_points(lidar.undistorted(clouds[name], twist), in_lidar.geometry)
            occlusion = np.minimum(occlusion, hits.occlusion[slots])
        return View(clouds, boxes, points, occlusion)


def within(users: Sequence[RoadUser], carrier: RoadUser, range_m: float) -> npt.NDArray[np.int64]:
    """Indices of those whose place is at most `range_m` from the carrier's, without itself."""
    places = np.array([user.position_m for user in users]).reshape(-1, 3)
    near = np.linalg.norm(places - carrier.position_m, axis=1) <= range_m
    near &= np.array([user.id != carrier.id for user in users], dtype=bool)
    return np.flatnonzero(near)
