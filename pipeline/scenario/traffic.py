"""The sections `traffic`, `trajectories`, `vehicles` and `bodies`: who is on the road, and who drives."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import AccelerationMps2, MeshScale, SpeedMps
from advpipe.pipeline.core.section import File, Name, NotNegative, Section, Whole, Word

BODIES = (
    "sedan",
    "hatchback",
    "estate",
    "suv",
    "pickup",
    "van",
    "minibus",
    "box_truck",
    "semi_trailer",
    "bus",
    "motorcycle",
    "scooter",
    "bicycle",
)
"""Bodies that drive on the road and come with advpipe; people on foot are counted by `pedestrians`."""

PEOPLE = ("pedestrian", "pedestrian_backpack", "pedestrian_suitcase", "pedestrian_umbrella", "child")
"""People on foot that come with advpipe."""


class UserBody(Section):
    """A body of the user's: a mesh file, x forward, z up; it fits the box that the mesh fills."""

    mesh: File = Field(description="path of an .obj, .ply, .stl, .glb or .off file")
    label: Literal["car", "truck", "cyclist", "pedestrian"] = Field(
        "car", description="class in the ground truth"
    )
    material: Word = Field("paint_silver", description="of the whole mesh")
    scale: MeshScale = Field(1.0, description="metres for each unit of the mesh")
    max_speed_mps: SpeedMps = 50.0
    acceleration_mps2: AccelerationMps2 = 2.6


class SumoServer(Section):
    """SUMO as a server of its own, which other programs may share; with `transport: traci` alone."""

    join: str | None = Field(
        None,
        pattern=r"^[A-Za-z0-9.-]{1,253}:[0-9]{1,5}$",
        description="host:port of a SUMO that runs already; one is started if left out",
    )
    port: Whole | None = Field(None, ge=1, le=65535, description="where ours listens; a free one if left out")
    clients: Whole = Field(1, ge=1, le=100, description="programs that step ours together, advpipe included")
    order: Whole = Field(1, ge=1, le=2**31 - 1, description="advpipe's turn among the clients in each step")

    @model_validator(mode="after")
    def _whose(self) -> SumoServer:
        if self.join is not None and (self.port is not None or self.clients > 1):
            raise ValueError(
                "port and clients apply only to a SUMO server that advpipe starts; leave them out "
                "when join is given"
            )
        return self


class Traffic(Section):
    """Who is on the road besides the instrumented vehicles, and what moves them."""

    source: Word = Field(
        "sumo",
        description="sumo; trajectories (those of the table and nobody else); or module:Class of your own",
    )
    transport: Literal["libsumo", "traci"] = Field(
        "libsumo", description="SUMO in this process, or a server; both give the same traffic"
    )
    server: SumoServer = SumoServer()
    vehicles: Whole = Field(80, ge=0, le=5000, description="kept on the network all the time")
    mix: dict[Word, Annotated[NotNegative, Field(le=1e6)]] = Field(
        {
            "sedan": 0.22,
            "hatchback": 0.18,
            "estate": 0.09,
            "suv": 0.19,
            "pickup": 0.04,
            "van": 0.07,
            "minibus": 0.02,
            "box_truck": 0.04,
            "semi_trailer": 0.02,
            "bus": 0.02,
            "motorcycle": 0.03,
            "scooter": 0.02,
            "bicycle": 0.06,
        },
        description="share of each body; normalised to one",
    )
    pedestrians: Whole = Field(40, ge=0, le=5000, description="people on foot beside the roads")
    parked_per_km: NotNegative = Field(15.0, le=150, description="parked cars per kilometre of kerb")
    routes: File | None = Field(
        None,
        description="a SUMO route file of the user's, which replaces `vehicles` and `mix`; "
        "its times count from the start of the warm-up",
    )
    sumo_config: File | None = Field(
        None,
        description="a .sumocfg of the user's: its route and additional files replace `vehicles` and `mix`",
    )

    @model_validator(mode="after")
    def _sources(self) -> Traffic:
        if self.vehicles and not sum(self.mix.values()) > 0:
            raise ValueError("mix needs at least one share above zero")
        if self.routes is not None and self.sumo_config is not None:
            raise ValueError("give at most one of routes and sumo_config")
        if self.server != SumoServer() and self.transport != "traci":
            raise ValueError("server needs transport: traci; set it too")
        return self


class Trajectories(Section):
    """Vehicles that are moved from outside; SUMO's own traffic reacts to them (world-driven mode)."""

    file: File = Field(
        description="CSV or Parquet table: id, time_s, x_m, y_m, z_m, yaw_rad (pitch_rad, roll_rad), body"
    )


class Vehicle(Section):
    """A vehicle that carries sensors.

    `traffic`: SUMO drives it. `trajectory`: the rows of the trajectory file with its id. `controller`: a
    bicycle model that follows its route with a controller of its own.
    """

    body: Word = "sedan"
    driver: Literal["traffic", "trajectory", "controller"] = "traffic"
    route: tuple[Word, ...] | None = Field(
        None, max_length=10_000, description="edges of the network in order; drawn from the seed if left out"
    )
    speed_mps: SpeedMps | None = Field(
        None, le=70, description="speed wished for where the road allows it; that of the road if left out"
    )


Vehicles = dict[Name, Vehicle]
