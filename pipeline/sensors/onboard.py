"""The sensors for a vehicle's localisation; `pipeline/localisation` holds their models."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.localisation.section import GnssSensor, ImuSensor, WheelOdometrySensor
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.sensor import Cadence, OnBoardSensor

IMU_BYTES = 380


class Gnss(OnBoardSensor[GnssSensor]):
    """The GNSS receiver."""

    title = "GNSS receiver"
    section = GnssSensor

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        return (VehicleTopics(vehicle).gnss_fix,)

    @classmethod
    def check(cls, sections: Mapping[str, GnssSensor], step_s: float) -> None:
        for section in sections.values():
            section.steps_per_fix(step_s)

    @classmethod
    def cadences(
        cls, vehicle: str, sections: Mapping[str, GnssSensor], step_s: float
    ) -> Mapping[str, Cadence]:
        (section,) = sections.values()
        return {VehicleTopics(vehicle).gnss_fix.name: Cadence(1 / step_s / section.steps_per_fix(step_s))}


class Imu(OnBoardSensor[ImuSensor]):
    """The inertial measurement unit."""

    title = "IMU"
    section = ImuSensor

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        return (VehicleTopics(vehicle).imu,)

    @classmethod
    def check(cls, sections: Mapping[str, ImuSensor], step_s: float) -> None:
        for section in sections.values():
            section.samples_per_step(step_s)

    @classmethod
    def cadences(
        cls, vehicle: str, sections: Mapping[str, ImuSensor], step_s: float
    ) -> Mapping[str, Cadence]:
        (section,) = sections.values()
        return {VehicleTopics(vehicle).imu.name: Cadence(section.rate_hz)}

    @classmethod
    def bytes_per_s(cls, section: ImuSensor) -> float:
        return section.rate_hz * IMU_BYTES


class WheelOdometry(OnBoardSensor[WheelOdometrySensor]):
    """Speed and turn rate from the wheels."""

    title = "wheel odometry"
    section = WheelOdometrySensor

    @classmethod
    def topics(cls, vehicle: str, name: str) -> tuple[Topic, ...]:
        return (VehicleTopics(vehicle).wheel_odometry,)
