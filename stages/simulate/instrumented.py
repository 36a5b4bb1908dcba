"""An instrumented vehicle: mounted sensors that observe the world, and on-board localisation."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import Protocol

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.measurements import InitialPose, SensedMotion
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.localisation.onboard import OnBoard, OnBoardStep
from advpipe.pipeline.scenario.models import Scenario
from advpipe.pipeline.sensors.sensor import DriveSettings, Instant, Reading
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.protocol import SensingSurroundings, World


@dataclass(frozen=True)
class VehicleSnapshot:
    """The measurements and estimate of one instrumented vehicle at one instant, and the truth.

    initial: initial pose of the filter, in the first snapshot only. readings: of each sensor section; they
    may still be in the making elsewhere, and are waited for when they are read.
    """

    vehicle: str
    initial: InitialPose | None
    onboard: OnBoardStep
    readings: Sequence[Reading]


class Elsewhere(Protocol):
    """The sensors of the instrumented vehicles in another process."""

    def readings(
        self, vehicle: str, frame: int, stamp_ns: int, motion: MotionStep, users: Sequence[RoadUser]
    ) -> Sequence[Reading]:
        """Of one vehicle, among all moving road users, with itself."""
        ...


class Instrumented:
    """All sensors of one vehicle. mounts: base_SE3_sensor (4, 4) by the name of each mounted sensor.

    keys: if given, only mounted sensors of these keys look.
    """

    def __init__(
        self,
        scenario: Scenario,
        name: str,
        elsewhere: Elsewhere | None = None,
        keys: Container[str] | None = None,
    ) -> None:
        self.name = name
        origin, clock = scenario.map.origin, scenario.simulation
        geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self._onboard = OnBoard(name, scenario.sensors, geodesy, clock.step_s, clock.seed)
        drive = DriveSettings(
            clock.seed,
            clock.step_s,
            scenario.environment.weather,
            scenario.recording.markers,
            origin.latitude_deg,
            origin.longitude_deg,
        )
        self._sensors = scenario.sensors.mounted_on(name, drive, keys)
        self.mounts = {place: pose for sensor in self._sensors for place, pose in sensor.mounts.items()}
        self._elsewhere = elsewhere
        self._started = False

    def sense(
        self, stamp_ns: int, frame: int, carrier: RoadUser, users: Sequence[RoadUser], world: World
    ) -> VehicleSnapshot:
        """Take all measurements of one step, among all moving road users."""
        surroundings = world.around(carrier, users)
        sensed = surroundings.sensed() if isinstance(surroundings, SensingSurroundings) else SensedMotion()
        onboard = self._onboard.step(stamp_ns, carrier.map_SE3_base, carrier.velocity_mps, sensed)
        initial = None if self._started else self._onboard.initial
        self._started = True
        readings = (
            self.look(Instant(frame, stamp_ns, onboard.truth, surroundings))
            if self._elsewhere is None
            else self._elsewhere.readings(self.name, frame, stamp_ns, onboard.truth, users)
        )
        return VehicleSnapshot(self.name, initial, onboard, readings)

    def look(self, instant: Instant) -> tuple[Reading, ...]:
        """The readings of the mounted sensors."""
        return tuple(sensor.sense(instant) for sensor in self._sensors)
