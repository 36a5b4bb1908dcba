"""The section `environment`: static objects beside the roads, and the weather."""

from __future__ import annotations

from pydantic import Field

from advpipe.pipeline.core.bounds import HeightM, MeshScale, PlaceM, YawRad
from advpipe.pipeline.core.section import File, NotNegative, Probability, Reference, Section
from advpipe.pipeline.sensors.weather import Weather


class UserObject(Section):
    """A static object given by the user's mesh, at a position in the map frame."""

    mesh: File = Field(description="path of an .obj, .ply, .stl, .glb or .off file")
    material: Reference = Field("concrete", description="material of the whole mesh")
    scale: MeshScale = Field(1.0, description="metres per unit of the mesh")
    x_m: PlaceM = 0.0
    y_m: PlaceM = 0.0
    z_m: HeightM = Field(0.0, description="height above the ground at that position")
    yaw_rad: YawRad = 0.0


class Environment(Section):
    """Static objects beside the roads, drawn from the seed, and the weather."""

    buildings: Probability = Field(0.6, description="share of the building plots with a building")
    trees_per_km: NotNegative = Field(25.0, le=500, description="trees per kilometre of kerb")
    poles_per_km: NotNegative = Field(30.0, le=500, description="lamp posts and signs per kilometre of kerb")
    clutter_per_km: NotNegative = Field(
        12.0, le=500, description="hedges, containers and cabinets per kilometre of kerb"
    )
    barriers: Probability = Field(0.3, description="share of the road edges with a guard rail or wall")
    objects: tuple[UserObject, ...] = Field((), max_length=10_000, description="meshes of your own")
    weather: Weather = Weather()
