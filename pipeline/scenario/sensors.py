"""The section `sensors`: what the instrumented vehicles carry."""

from __future__ import annotations

from pydantic import Field, model_validator

from advpipe.pipeline.core.section import (
    Name,
    Section,
)
from advpipe.pipeline.localisation.section import (
    GnssSensor,
    ImuSensor,
    LocalisationFilter,
    WheelOdometrySensor,
)
from advpipe.pipeline.sensors.lidar.section import LidarSensor

VEHICLE_FRAMES = ("base_link", "imu", "odom")
"""Frames that each vehicle has beside those of its LiDARs, which have their names."""


class Sensors(Section):
    """What the instrumented vehicles carry: LiDARs by name, and on each vehicle all the rest."""

    lidars: dict[Name, LidarSensor] = Field({"lidar": LidarSensor()}, max_length=100, description="by name")
    gnss: GnssSensor = GnssSensor()
    imu: ImuSensor = ImuSensor()
    wheel_odometry: WheelOdometrySensor = WheelOdometrySensor()
    localisation: LocalisationFilter = LocalisationFilter()

    @model_validator(mode="after")
    def _frames(self) -> Sensors:
        taken = next((name for name in self.lidars if name in VEHICLE_FRAMES), None)
        if taken is not None:
            raise ValueError(f"lidars.{taken} has the name of another frame of its vehicle; rename it")
        return self

    def check_rates(self, step_s: float) -> None:
        """ValueError where the rate of a sensor does not fit the step."""
        self.gnss.steps_per_fix(step_s)
        self.imu.samples_per_step(step_s)
