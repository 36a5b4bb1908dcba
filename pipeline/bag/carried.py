"""Which topics of a bag are which sensor's, as the scenario in the bag says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import Field

from advpipe.pipeline.bag.latched import latched_text
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import Document, ShortText, read_json, validated
from advpipe.pipeline.core.section import Name
from advpipe.pipeline.messages.debug import is_debug
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.pipeline.sensors.lidar.lidars import Lidars
from advpipe.pipeline.sensors.registry import SENSORS
from advpipe.pipeline.sensors.sensor import MountedSensor, Panel, Sensor

CLOUD_TYPE = "sensor_msgs/msg/PointCloud2"


class _Mounted(Document):
    vehicle: Name = "ego"


class ScenarioSensors(Document):
    """The sensors of a scenario, of any release; None where it names none, as in another tool's bag."""

    vehicles: dict[Name, object] = Field(default_factory=dict)
    sensors: dict[ShortText, dict[ShortText, Any]] | None = None


@dataclass(frozen=True)
class CarriedSensor:
    """One sensor of a recorded drive. key: of its kind in `sensors`. name: "" where a vehicle has but one."""

    key: str
    kind: type[Sensor[Any]] = field(repr=False)
    vehicle: str
    name: str

    def panel(self, topic: str) -> Panel | None:
        """How viewers show one of its topics; None for what they do not show."""
        return self.kind.panels(self.vehicle, self.name).get(topic)


def sensors_by_topic(reader: BagReader) -> Mapping[str, CarriedSensor] | None:
    """What a drive's scenario says of its topics; None for a bag without one, which another tool made.

    Raises AdvpipeError for a scenario that cannot be read.
    """
    if SCENARIO_INFO.name not in reader.topics or not reader.topics[SCENARIO_INFO.name].count:
        return None
    if reader.topics[SCENARIO_INFO.name].type != SCENARIO_INFO.type:
        return None
    text = latched_text(reader, SCENARIO_INFO.name)
    return sensors_of_scenario(text, f"{reader.path}: {SCENARIO_INFO.name} holds no scenario")


def sensors_of_scenario(text: str, where: str) -> Mapping[str, CarriedSensor] | None:
    """The same of the scenario in JSON; where: the bag and topic that errors name."""
    info: ScenarioSensors = read_json(text, ScenarioSensors, where, "record it again")
    if info.sensors is None:
        return None
    return {
        topic.name: sensor
        for sensor in _carried(info, where)
        for topic in sensor.kind.topics(sensor.vehicle, sensor.name)
    }


def _carried(info: ScenarioSensors, where: str) -> Iterator[CarriedSensor]:
    for key, configured in (info.sensors or {}).items():
        kind = SENSORS.get(key)
        if kind is None:  # the filter's part, or a sensor of another release
            continue
        if issubclass(kind, MountedSensor):
            mounted = validated(
                configured, dict[Name, _Mounted], f"{where}: sensors.{key}", "record it again"
            )
            for name, section in mounted.items():
                yield CarriedSensor(key, kind, section.vehicle, name)
        else:
            for vehicle in info.vehicles:
                yield CarriedSensor(key, kind, vehicle, "")


def lidar_topics(reader: BagReader) -> list[str]:
    """The topics of LiDAR clouds, sorted; in another tool's bag, all topics of point clouds."""
    clouds = [name for name in reader.topics_of_type(CLOUD_TYPE) if not is_debug(name)]
    known = sensors_by_topic(reader)
    if known is None:
        return clouds
    return [name for name in clouds if is_lidar(known.get(name))]


def is_lidar(sensor: CarriedSensor | None) -> bool:
    """Whether a topic's sensor is a LiDAR; None stands for no sensor of the scenario's."""
    return sensor is not None and issubclass(sensor.kind, Lidars)
