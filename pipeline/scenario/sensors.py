"""The section `sensors`: what the instrumented vehicles carry, as the registry of sensors has it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from pydantic import create_model, model_validator

from advpipe.pipeline.core.section import Section
from advpipe.pipeline.localisation.section import (
    GnssSensor,
    ImuSensor,
    LocalisationFilter,
    WheelOdometrySensor,
)
from advpipe.pipeline.sensors.registry import SENSORS
from advpipe.pipeline.sensors.sensor import DriveSettings, MountedSection, MountedSensor, Sensor

VEHICLE_FRAMES = ("base_link", "imu", "odom")
"""Frames that each vehicle has beside those of its mounted sensors, which have their names."""


class CarriedSensors(Section):
    """What the instrumented vehicles carry: LiDARs by name, and on each vehicle all the rest."""

    @model_validator(mode="after")
    def _frames(self) -> CarriedSensors:
        taken: set[tuple[str, str]] = set()
        for place, name, section in self.mounted():
            if name in VEHICLE_FRAMES:
                raise ValueError(f"{place} has the name of another frame of its vehicle; rename it")
            if (section.vehicle, name) in taken:
                raise ValueError(f"{place} has the name of another sensor of its vehicle; rename it")
            taken.add((section.vehicle, name))
        return self

    def mounted(self) -> Iterator[tuple[str, str, MountedSection]]:
        """Every sensor that is carried by name: its place in the section, its name, and its settings."""
        for key, kind in SENSORS.items():
            if issubclass(kind, MountedSensor):
                for name, section in getattr(self, key).items():
                    yield f"{key}.{name}", name, section

    def mounted_by(self, vehicle: str) -> Iterator[tuple[str, type[MountedSensor[Any]]]]:
        """The kinds of which a vehicle carries any by name, with their keys."""
        for key, kind in SENSORS.items():
            if issubclass(kind, MountedSensor) and kind.carried_by(vehicle, getattr(self, key)):
                yield key, kind

    def mounted_on(self, vehicle: str, drive: DriveSettings) -> list[MountedSensor[Any]]:
        """Those of a vehicle, made for a drive."""
        return [
            kind(vehicle, kind.carried_by(vehicle, getattr(self, key)), drive)
            for key, kind in self.mounted_by(vehicle)
        ]

    def carried_by(self, vehicle: str) -> Iterator[tuple[type[Sensor[Any]], Mapping[str, Section]]]:
        """All sensors of a vehicle, kind by kind, by their names."""
        for key, kind in SENSORS.items():
            yield kind, kind.carried_by(vehicle, getattr(self, key))

    def check(self, step_s: float) -> None:
        """ValueError where sensors do not fit the step, or ask for too much together."""
        for key, kind in SENSORS.items():
            configured = getattr(self, key)
            kind.check(configured if issubclass(kind, MountedSensor) else {"": configured}, step_s)


if TYPE_CHECKING:

    class Sensors(CarriedSensors):
        """What localisation on board reads; all other keys are read through the registry."""

        gnss: GnssSensor = GnssSensor()
        imu: ImuSensor = ImuSensor()
        wheel_odometry: WheelOdometrySensor = WheelOdometrySensor()
        localisation: LocalisationFilter = LocalisationFilter()

else:
    Sensors = create_model(
        "Sensors",
        __base__=CarriedSensors,
        __module__=__name__,
        __doc__=CarriedSensors.__doc__,
        **{key: kind.scenario_field() for key, kind in SENSORS.items()},
        localisation=(LocalisationFilter, LocalisationFilter()),
    )
