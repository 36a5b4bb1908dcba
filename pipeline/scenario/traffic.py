"""The sections `traffic`, `trajectories`, `vehicles` and `bodies`: the road users and what moves them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import AccelerationMps2, MeshScale, SpeedMps
from advpipe.pipeline.core.section import File, Name, NotNegative, Reference, Section, Whole
from advpipe.pipeline.scenario import fleet

BODIES = (*fleet.CARS, *fleet.OTHERS)
"""Built-in bodies of vehicles; the key `pedestrians` sets the number of people on foot."""

ANY_CAR = "car"
"""In a mix: all cars, in the shares of the fleet."""

PEOPLE = tuple(fleet.PEOPLE)
"""Built-in bodies of people on foot."""


class UserBody(Section):
    """A body given by the user's mesh, x forward and z up; its box is the mesh's bounding box."""

    mesh: File = Field(description="path of an .obj, .ply, .stl, .glb or .off file")
    label: Literal["car", "truck", "cyclist", "pedestrian"] = Field(
        "car", description="class in the ground truth"
    )
    material: Reference = Field("paint_silver", description="material of the whole mesh")
    scale: MeshScale = Field(1.0, description="metres per unit of the mesh")
    max_speed_mps: SpeedMps = Field(50.0, description="highest speed")
    acceleration_mps2: AccelerationMps2 = Field(2.6, description="highest acceleration")


class SumoServer(Section):
    """SUMO as a separate server that other programs may share; only with `transport: traci`."""

    join: str | None = Field(
        None,
        pattern=r"^[A-Za-z0-9.-]{1,253}:[0-9]{1,5}$",
        description="host:port of a running SUMO to join; by default advpipe starts one",
    )
    port: Whole | None = Field(
        None, ge=1, le=65535, description="port of the SUMO that advpipe starts; a free one by default"
    )
    clients: Whole = Field(
        1, ge=1, le=100, description="number of clients of the SUMO that advpipe starts, advpipe included"
    )
    order: Whole = Field(1, ge=1, le=2**31 - 1, description="advpipe's turn among the clients in each step")

    @model_validator(mode="after")
    def _join_or_start(self) -> SumoServer:
        if self.join is not None and (self.port is not None or self.clients > 1):
            raise ValueError(
                "port and clients apply only to a SUMO server that advpipe starts; leave them out "
                "when join is given"
            )
        return self


class Traffic(Section):
    """The road users besides the instrumented vehicles, and what moves them."""

    source: Reference = Field(
        "sumo",
        description="sumo; trajectories (only the vehicles of the table, without SUMO); or module:Class of "
        "your own",
    )
    transport: Literal["libsumo", "traci"] = Field(
        "libsumo",
        description="SUMO in this process (libsumo) or as a server (traci); both give the same traffic",
    )
    server: SumoServer = SumoServer()
    vehicles: Whole = Field(80, ge=0, le=5000, description="number of vehicles on the network at any time")
    mix: dict[Reference, Annotated[NotNegative, Field(le=1e6)]] = Field(
        fleet.DEFAULT_MIX,
        description="share of each body among the vehicles, where `car` stands for the cars of a European "
        "fleet; the shares are normalised to a sum of 1",
    )
    pedestrians: Whole = Field(40, ge=0, le=5000, description="number of people on foot beside the roads")
    parked_per_km: NotNegative = Field(45.0, le=150, description="parked cars per kilometre of kerb")
    routes: File | None = Field(
        None,
        description="path of a SUMO route file of your own, which replaces `vehicles` and `mix`; "
        "its times count from the start of the warm-up",
    )
    sumo_config: File | None = Field(
        None,
        description="path of a .sumocfg of your own, whose route and additional files replace `vehicles` and "
        "`mix`",
    )

    @property
    def shares(self) -> dict[str, float]:
        """Share of each body among the vehicles: the mix, with `car` divided among the cars."""
        mix = dict(self.mix)
        cars = mix.pop(ANY_CAR, 0.0)
        for body, share in fleet.CAR_SHARES.items() if cars else ():
            mix[body] = mix.get(body, 0.0) + cars * share
        total = sum(mix.values())
        return {body: share / total for body, share in mix.items()}

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
    """Vehicles that follow given trajectories; SUMO's traffic reacts to them (world-driven mode)."""

    file: File = Field(
        description="CSV or Parquet table: id, time_s, x_m, y_m, z_m, yaw_rad (pitch_rad, roll_rad), body"
    )


class Vehicle(Section):
    """A vehicle that carries sensors.

    Drivers: `traffic`: SUMO drives it. `trajectory`: it follows the rows with its id in the trajectory file.
    `controller`: a bicycle model with a controller of its own follows its route. `carla`: an actor of CARLA,
    with the vehicle's name as its role_name; without one, CARLA's Traffic Manager drives it.
    """

    body: Reference = Field("sedan", description="a built-in body or one of `bodies`")
    driver: Literal["traffic", "trajectory", "controller", "carla"] = Field(
        "traffic", description="what drives the vehicle"
    )
    route: tuple[Reference, ...] | None = Field(
        None, max_length=10_000, description="edges of the network in order; drawn from the seed by default"
    )
    speed_mps: SpeedMps | None = Field(
        None, le=70, description="desired speed where the road allows it; by default the road's speed limit"
    )

    @property
    def is_in_sumo(self) -> bool:
        """Whether SUMO inserts it; others are placed there from outside."""
        return self.driver in ("traffic", "controller")


Vehicles = dict[Name, Vehicle]
