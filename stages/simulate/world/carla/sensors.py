"""All of CARLA's sensors on one vehicle."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.measurements import SensedMotion
from advpipe.pipeline.messages.topic_names import CARLA_ROS_BRIDGE
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.camera.section import CameraSensor
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.sensor import MountedSection
from advpipe.stages.simulate.world.carla.cameras import CarlaCamera, check_camera
from advpipe.stages.simulate.world.carla.feeds import FIRST_TICKS, Feed
from advpipe.stages.simulate.world.carla.lidar import CarlaLidar, check_lidar
from advpipe.stages.simulate.world.carla.poses import ActorBox, pose_of
from advpipe.stages.simulate.world.carla.positioning import (
    GNSS,
    IMU,
    GnssProjection,
    specific_force_of,
    turn_rate_of,
)
from advpipe.stages.simulate.world.carla.radars import RADAR, CarlaRadar, check_radar

LIDAR, SEMANTIC_LIDAR = "sensor.lidar.ray_cast", "sensor.lidar.ray_cast_semantic"

PLACE_TOLERANCE_M = 0.05
"""How far a sensor may be from where it should be: one step late, it would be a metre off at 10 m/s."""

POLL_S = 0.2


class MountedInCarla(Protocol):
    """One sensor of the scenario in CARLA. attributes: of the blueprints that together stand for it."""

    @property
    def base_SE3_sensor(self) -> Float64: ...
    @property
    def attributes(self) -> Mapping[str, Mapping[str, object]]: ...

    def is_due(self, frame: int) -> bool:
        """Whether it measures at this frame of the drive."""
        ...


KINDS: Mapping[str, Callable[[Any, float], MountedInCarla]] = {
    "lidars": CarlaLidar,
    "radars": CarlaRadar,
    "cameras": CarlaCamera,
}
"""By their keys in the scenario's section `sensors`; made from a section and the drive's step."""


def check_sensor(place: str, section: MountedSection) -> None:
    """Raise UsageError for settings of a sensor that CARLA lacks."""
    if isinstance(section, LidarSensor):
        check_lidar(place, section)
    elif isinstance(section, CameraSensor):
        check_camera(place, section)
    elif isinstance(section, RadarSensor):
        check_radar(place, section)


class VehicleSensors:
    """Each sensor is a feed; `take` reads them all for one frame.

    is_driven_by_carla: then CARLA's physics moves it, and its IMU measures; it measures nothing of a vehicle
    that is moved from outside. records_semantic: whether the drive records what its semantic LiDARs measure.
    """

    def __init__(self, scenario: Scenario, vehicle: str, is_driven_by_carla: bool) -> None:
        self._vehicle, self._has_imu = vehicle, is_driven_by_carla
        self.records_semantic = scenario.recording.names == CARLA_ROS_BRIDGE
        self._timeout_s, step_s = scenario.carla.timeout_s, scenario.simulation.step_s
        self._mounted: dict[str, MountedInCarla] = {
            name: kind(section, step_s)
            for key, kind in KINDS.items()
            for name, section in getattr(scenario.sensors, key, {}).items()
            if section.vehicle == vehicle
        }
        self._feeds: dict[tuple[str, str], Feed] = {}
        self._data: dict[tuple[str, str], Any] = {}
        self._projection: GnssProjection | None = None

    def mount(self, world: Any, carrier: Any, box: ActorBox) -> None:
        """Spawn the sensors on the vehicle's actor, which has this box, and listen."""

        def feed(
            name: str, blueprint: str, attributes: Mapping[str, object], base_SE3_sensor: Float64
        ) -> None:
            title = f"{blueprint.removeprefix('sensor.')} of {self._vehicle}{f'/{name}' if name else ''}"
            place = box.actor_SE3_base @ base_SE3_sensor
            self._feeds[name, blueprint] = Feed(world, carrier, title, blueprint, attributes, place)

        for name, sensor in self._mounted.items():
            for blueprint, attributes in sensor.attributes.items():
                feed(name, blueprint, attributes, sensor.base_SE3_sensor)
        feed("", GNSS, {}, np.eye(4))
        if self._has_imu:
            feed("", IMU, {}, np.eye(4))
        self._projection = GnssProjection(world.get_map())

    def await_first(self, tick: Callable[[], object], timeout_s: float) -> None:
        """Tick until each sensor has sent something; then wait, as the first pictures of a scene take long.

        Raises AdvpipeError if one sends nothing.
        """
        silent = list(self._feeds.values())
        for _ in range(FIRST_TICKS):
            tick()
            silent = [feed for feed in silent if not feed.has_sent(POLL_S)]
            if not silent:
                return
        until_s = time.monotonic() + timeout_s
        for feed in silent:
            if not feed.has_sent(max(until_s - time.monotonic(), 0.0)):
                raise AdvpipeError(
                    f"CARLA's sensor {feed.name} sends nothing, after {FIRST_TICKS} ticks and {timeout_s:g} s"
                )

    def take(self, carla_frame: int, frame: int, map_SE3_base: Float64) -> None:
        """Read the measurements of a frame, of the sensors that are due.

        Raises AdvpipeError for one that is missing, or measured from another place than it should be.
        """
        self._data = {}
        for (name, blueprint), feed in self._feeds.items():
            sensor = self._mounted.get(name)
            if sensor is not None and not sensor.is_due(frame):
                feed.skip()
                continue
            data = feed.take(carla_frame, self._timeout_s)
            expected = map_SE3_base if sensor is None else map_SE3_base @ sensor.base_SE3_sensor
            off_m = float(np.linalg.norm(pose_of(data.transform)[:3, 3] - expected[:3, 3]))
            if off_m > PLACE_TOLERANCE_M:
                raise AdvpipeError(
                    f"CARLA's sensor {feed.name} measured {off_m:.2f} m from its place in frame "
                    f"{carla_frame}: the vehicle's actor is moved by something else, or shows its pose late"
                )
            self._data[name, blueprint] = data

    def turn(self, name: str) -> tuple[CarlaLidar, Any, Any]:
        """A LiDAR, its measurement, and that of the semantic LiDAR in its place."""
        lidar = self._mounted[name]
        assert isinstance(lidar, CarlaLidar)
        return lidar, self._data[name, LIDAR], self._data[name, SEMANTIC_LIDAR]

    def pictures(self, name: str) -> tuple[CarlaCamera, Mapping[str, Any]]:
        """A camera, and its images by blueprint."""
        camera = self._mounted[name]
        assert isinstance(camera, CarlaCamera)
        return camera, {blueprint: self._data[name, blueprint] for blueprint in camera.attributes}

    def scan(self, name: str) -> tuple[CarlaRadar, Any]:
        """A radar, and its measurement."""
        radar = self._mounted[name]
        assert isinstance(radar, CarlaRadar)
        return radar, self._data[name, RADAR]

    def sensed(self) -> SensedMotion:
        """What GNSS and IMU measured; see `SensedMotion`."""
        assert self._projection is not None
        position_m = self._projection.position_m(self._data["", GNSS])
        if not self._has_imu:
            return SensedMotion(position_m)
        imu = self._data["", IMU]
        return SensedMotion(position_m, specific_force_of(imu), turn_rate_of(imu))

    def stop(self) -> list[int]:
        """Stop every sensor; the numbers of their actors, which are to be removed."""
        for feed in self._feeds.values():
            feed.stop()
        return [feed.actor for feed in self._feeds.values()]
