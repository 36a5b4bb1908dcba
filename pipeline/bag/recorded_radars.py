"""The radars of a recorded drive, as the scenario in the bag describes them."""

from __future__ import annotations

from dataclasses import dataclass, field

from pydantic import Field

from advpipe.pipeline.bag.latched import read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import Document
from advpipe.pipeline.core.section import Name
from advpipe.pipeline.messages.radar import SCAN_TYPE
from advpipe.pipeline.messages.topics import SCENARIO_INFO, VehicleTopics
from advpipe.pipeline.sensors.radar.radar import Radar
from advpipe.pipeline.sensors.radar.section import RadarSensor
from advpipe.pipeline.sensors.weather import Weather


class _Sensors(Document):
    radars: dict[Name, RadarSensor] = Field(default_factory=dict)


class _Environment(Document):
    weather: Weather = Field(default_factory=Weather)


class RadarInfo(Document):
    """What a radar's measurements depend on."""

    sensors: _Sensors = Field(default_factory=_Sensors)
    environment: _Environment = Field(default_factory=_Environment)


@dataclass(frozen=True)
class RecordedRadar:
    """One radar of a drive. radar: its model, for its weather."""

    vehicle: str
    name: str
    radar: Radar = field(repr=False)

    @property
    def scan_topic(self) -> str:
        """Of its detections."""
        return VehicleTopics(self.vehicle).radar_scan(self.name).name

    @property
    def points_topic(self) -> str:
        """Of the same as points."""
        return VehicleTopics(self.vehicle).radar_points(self.name).name


def recorded_radars(reader: BagReader) -> list[RecordedRadar]:
    """The radars whose scans a bag holds; none for a bag of another tool.

    Raises AdvpipeError for a bag whose scenario is none of this version.
    """
    scans = set(reader.topics_of_type(SCAN_TYPE))
    if not scans or SCENARIO_INFO.name not in reader.topics:
        return []
    info: RadarInfo = read_scenario_info(reader, RadarInfo)
    found = [
        RecordedRadar(section.vehicle, name, Radar(section, 0.1, info.environment.weather))
        for name, section in info.sensors.radars.items()
    ]
    return [one for one in found if one.scan_topic in scans]
