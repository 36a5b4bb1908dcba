"""The section `environment`: what stands beside the roads, and the weather."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import HeightM, MeshScale, PlaceM, YawRad
from advpipe.pipeline.core.section import File, NotNegative, Positive, Probability, Section, Word

LEAST_RATE_MM_PER_H = 0.0001
"""Of rain and snow: less is far below what is measured, and calls for clear weather."""


class Weather(Section):
    """Rain and snow by their rate, fog by the distance that one sees; it lasts for the whole drive.

    Rain and snow act on LiDARs as in LISA (Kilic et al. 2021), fog as in Hahner et al. (ICCV 2021).
    """

    kind: Literal["clear", "rain", "fog", "snow"] = "clear"
    rate_mm_per_h: NotNegative = Field(0.0, le=200, description="of rain, or of melted snow")
    visibility_m: Positive = Field(1e5, ge=5, le=1e5, description="meteorological optical range in fog")

    @model_validator(mode="after")
    def _strength(self) -> Weather:
        if self.kind in ("rain", "snow") and self.rate_mm_per_h < LEAST_RATE_MM_PER_H:
            raise ValueError(f"{self.kind} needs its rate_mm_per_h, of at least {LEAST_RATE_MM_PER_H:g}")
        if self.kind == "fog" and self.visibility_m > 1000:
            raise ValueError("fog needs its visibility_m, of at most 1000")
        if self.kind in ("clear", "fog") and self.rate_mm_per_h:
            raise ValueError(f"rate_mm_per_h is given, but kind is {self.kind}; make it rain or snow")
        if self.kind != "fog" and self.visibility_m < 1e5:
            raise ValueError(f"visibility_m is given, but kind is {self.kind}; make it fog")
        return self


class UserObject(Section):
    """A mesh of the user's that stands somewhere in the map's frame."""

    mesh: File = Field(description="path of an .obj, .ply, .stl, .glb or .off file")
    material: Word = "concrete"
    scale: MeshScale = Field(1.0, description="metres for each unit of the mesh")
    x_m: PlaceM = 0.0
    y_m: PlaceM = 0.0
    z_m: HeightM = Field(0.0, description="above the ground at that place")
    yaw_rad: YawRad = 0.0


class Environment(Section):
    """What stands beside the roads, drawn from the seed, and the weather."""

    buildings: Probability = Field(0.6, description="share of the building plots that are built on")
    trees_per_km: NotNegative = Field(25.0, le=500, description="per kilometre of kerb")
    poles_per_km: NotNegative = Field(30.0, le=500, description="lamp posts and signs per kilometre of kerb")
    clutter_per_km: NotNegative = Field(12.0, le=500, description="hedges, containers, cabinets")
    barriers: Probability = Field(0.3, description="share of the road edges with a guard rail or wall")
    objects: tuple[UserObject, ...] = Field((), max_length=10_000, description="meshes of the user's")
    weather: Weather = Weather()
