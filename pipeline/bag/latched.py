"""Documents that a bag holds in a latched message of text: the scenario, V2X statistics, footprints."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import LONGEST_TEXT, Document, read_json
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.section import Name
from advpipe.pipeline.messages.topics import SCENARIO_INFO
from advpipe.pipeline.scenario.map import GeoOrigin
from advpipe.pipeline.scenario.sensors import Sensors
from advpipe.pipeline.scenario.simulation import Simulation
from advpipe.pipeline.v2x.section import V2x


class _Map(Document):
    origin: GeoOrigin


class FilterInfo(Document):
    """What filters assume: the part of the scenario that they need to run again."""

    sensors: Sensors
    map: _Map
    simulation: Simulation


class V2xInfo(Document):
    """What radio and maps depend on. vehicles: the instrumented ones, by name."""

    v2x: V2x
    map: _Map
    simulation: Simulation
    vehicles: dict[Name, object]


class ReceiversInfo(Document):
    """What evaluating receptions needs: of a drive that another tool recorded, the map's origin is enough."""

    map: _Map
    v2x: V2x = Field(default_factory=V2x)
    vehicles: dict[Name, object] = Field(default_factory=dict)


def read_scenario_info(reader: BagReader, part: Any) -> Any:
    """A part of the scenario of a drive, such as `FilterInfo`.

    Raises AdvpipeError for a bag whose scenario is none of this version.
    """
    where = f"{reader.path}: {SCENARIO_INFO.name} does not hold a scenario of this version"
    return read_latched(reader, SCENARIO_INFO.name, part, where)


def read_latched(
    reader: BagReader, topic: str, kind: Any, where: str, limit_bytes: int = LONGEST_TEXT
) -> Any:
    """The document in the last message of a topic of texts; raises AdvpipeError where there is none."""
    text = latched_text(reader, topic)
    return read_json(text, kind, where, "record it again", limit_bytes)


def latched_text(reader: BagReader, topic: str) -> str:
    """The last message of a topic of texts; raises AdvpipeError where there is none."""
    text: str | None = None
    for _, message in reader.messages(topic):
        text = message.data
    if text is None:
        raise AdvpipeError(f"{reader.path}: {topic} holds no message; record it again")
    return text
