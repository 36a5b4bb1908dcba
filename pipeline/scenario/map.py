"""The section `map`: the road network and its geographic origin."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import BlockM
from advpipe.pipeline.core.section import File, Number, Positive, Section, Whole

MAP_SOURCES = ("opendrive", "sumo_net", "generator")


class GeoOrigin(Section):
    """The geographic position (WGS 84) of the origin of the map frame."""

    latitude_deg: Number = Field(48.1351, ge=-85, le=85)
    longitude_deg: Number = Field(11.5820, ge=-180, le=180)
    altitude_m: Number = Field(520.0, ge=-500, le=9000)


class Generator(Section):
    """A road network that SUMO's netgenerate draws from the scenario's seed."""

    kind: Literal["grid", "spider", "random"] = "grid"
    size: Whole = Field(
        4,
        ge=2,
        le=40,
        description="junctions along each side of a grid; arms of a spider web, with half as many rings; "
        "a random network has about size² junctions",
    )
    block_m: BlockM = Field(160.0, description="distance between junctions")
    lanes: Whole = Field(2, ge=1, le=4, description="lanes in each direction")
    speed_mps: Positive = Field(13.89, ge=1, le=70, description="speed limit")


class Map(Section):
    """The road network: exactly one of `opendrive`, `sumo_net` and `generator`."""

    opendrive: File | None = Field(None, description="path of an OpenDRIVE .xodr file")
    sumo_net: File | None = Field(None, description="path of a SUMO .net.xml file")
    generator: Generator | None = Field(None, description="settings of a generated network")
    origin: GeoOrigin = GeoOrigin()

    @model_validator(mode="after")
    def _one_source(self) -> Map:
        if sum(getattr(self, source) is not None for source in MAP_SOURCES) != 1:
            raise ValueError("give exactly one of opendrive, sumo_net and generator")
        return self
