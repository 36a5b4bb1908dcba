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

    buildings: Probability = Field(
        0.75, description="share of the parcels along streets with houses; a third of it beside rural roads"
    )
    rows: Probability = Field(
        0.35, description="share of the streets whose houses stand in rows, wall to wall"
    )
    fences: Probability = Field(
        0.55,
        description="share of the parcels enclosed by fences or walls; 0.3 of it: noise barriers beside "
        "fast roads",
    )
    hedges: Probability = Field(0.4, description="share of the parcels enclosed by hedges")
    slopes: Probability = Field(
        0.35, description="share of the gardens with banks, terraces or a rise; how hilly the land is beyond"
    )
    wires: Probability = Field(0.25, description="share of the streets with overhead wires on poles")
    trees_per_km: NotNegative = Field(55.0, le=500, description="trees per kilometre of kerb")
    bushes_per_km: NotNegative = Field(
        90.0, le=500, description="bushes, beds and tufts of rough grass per kilometre of kerb"
    )
    poles_per_km: NotNegative = Field(30.0, le=500, description="lamp posts and signs per kilometre of kerb")
    clutter_per_km: NotNegative = Field(
        16.0, le=500, description="bins, cabinets, benches, bicycle stands and shelters per kilometre of kerb"
    )
    barriers: Probability = Field(0.3, description="share of the road edges with a guard rail or wall")
    objects: tuple[UserObject, ...] = Field((), max_length=10_000, description="meshes of your own")
    weather: Weather = Weather()
