"""The section `sensors`: the sensors of the instrumented vehicles; its keys are those of the registry."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from pydantic import SerializerFunctionWrapHandler, create_model, model_serializer, model_validator

from advpipe.pipeline.core.section import Section
from advpipe.pipeline.localisation.section import (
    GnssSensor,
    ImuSensor,
    LocalisationFilter,
    WheelOdometrySensor,
)
from advpipe.pipeline.messages.topic_names import published_name
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.registry import SENSORS
from advpipe.pipeline.sensors.sensor import DriveSettings, MountedSection, MountedSensor, Sensor

VEHICLE_FRAMES = ("base_link", "imu", "odom")
"""Frames that each vehicle has besides those of its mounted sensors, which are named after the sensors."""


class CarriedSensors(Section):
    """The sensors of the instrumented vehicles: LiDARs by name; each vehicle carries all other sensors."""

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

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without kinds of sensors that no vehicle has by default: drives are recorded as before there were
        any."""
        tree: dict[str, Any] = handler(self)
        return {key: each for key, each in tree.items() if each or type(self).model_fields[key].default != {}}

    def mounted(self) -> Iterator[tuple[str, str, MountedSection]]:
        """Yield every sensor that is configured by name: its key path in this section, name and settings."""
        for key, sensor in SENSORS.items():
            if issubclass(sensor, MountedSensor):
                for name, section in getattr(self, key).items():
                    yield f"{key}.{name}", name, section

    def mounted_by(self, vehicle: str) -> Iterator[tuple[str, type[MountedSensor[Any]]]]:
        """Yield the class of each sensor that a vehicle carries by name, with its key in this section."""
        for key, sensor in SENSORS.items():
            if issubclass(sensor, MountedSensor) and sensor.carried_by(vehicle, getattr(self, key)):
                yield key, sensor

    def mounted_on(
        self, vehicle: str, drive: DriveSettings, keys: Container[str] | None = None
    ) -> list[MountedSensor[Any]]:
        """Make the sensors that a vehicle carries by name, for a drive; keys: only those of these keys."""
        return [
            sensor(vehicle, sensor.carried_by(vehicle, getattr(self, key)), drive)
            for key, sensor in self.mounted_by(vehicle)
            if keys is None or key in keys
        ]

    def carried_by(self, vehicle: str) -> Iterator[tuple[type[Sensor[Any]], Mapping[str, Section]]]:
        """Yield each class of sensors with the settings of those that a vehicle carries, by name."""
        for key, sensor in SENSORS.items():
            yield sensor, sensor.carried_by(vehicle, getattr(self, key))

    def check(self, step_s: float) -> None:
        """Raise ValueError for sensors whose rates do not fit the step, or that are too many together."""
        for key, sensor in SENSORS.items():
            configured = getattr(self, key)
            sensor.check(configured if issubclass(sensor, MountedSensor) else {"": configured}, step_s)

    def check_names(self, vehicles: Iterable[str], names: str, step_s: float, has_semantic: bool) -> None:
        """Raise ValueError where two topics would be published under one name.

        names: `recording.names`; has_semantic: whether the drive records what semantic LiDARs measure. The
        rates fit the step.
        """
        for vehicle in vehicles:
            published: dict[str, tuple[str, str]] = {}
            for place, topic in self._topics(vehicle, step_s, has_semantic):
                name = published_name(topic, names)
                other, other_topic = published.setdefault(name, (place, topic))
                if other_topic != topic:
                    raise ValueError(
                        f"recording.names {names} publishes both a topic of {other} and one of {place} as "
                        f"{name}; rename one of the sensors"
                    )

    def _topics(self, vehicle: str, step_s: float, has_semantic: bool) -> Iterator[tuple[str, str]]:
        """Yield what a vehicle's sensors record: whose topic it is, and its name."""
        yield "the true odometry", VehicleTopics(vehicle).true_odometry.name
        for key, sensor in SENSORS.items():
            if not issubclass(sensor, MountedSensor):
                yield from ((f"sensors.{key}", topic.name) for topic in sensor.topics(vehicle, ""))
                continue
            for name, section in sensor.carried_by(vehicle, getattr(self, key)).items():
                recorded = sensor.cadences(vehicle, {name: section}, step_s)
                yield from ((f"sensors.{key}.{name}", topic) for topic in recorded)
                if has_semantic and isinstance(section, LidarSensor):
                    semantic = VehicleTopics(vehicle, name).semantic_points
                    yield f"sensors.{key}.{name}", semantic.name


if TYPE_CHECKING:

    class Sensors(CarriedSensors):
        """The keys that on-board localisation reads; all other keys are read through the registry."""

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
        **{key: sensor.scenario_field() for key, sensor in SENSORS.items()},
        localisation=(LocalisationFilter, LocalisationFilter()),
    )
