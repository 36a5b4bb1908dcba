"""The scenario file as a whole: its sections, and the checks across them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.section import Implementation, Name, Section, Switch
from advpipe.pipeline.scenario.attacks import Attacks
from advpipe.pipeline.scenario.environment import Environment
from advpipe.pipeline.scenario.map import Map
from advpipe.pipeline.scenario.sensors import Sensors
from advpipe.pipeline.scenario.simulation import Simulation
from advpipe.pipeline.scenario.size import check_size
from advpipe.pipeline.scenario.traffic import (
    BODIES,
    PEOPLE,
    Traffic,
    Trajectories,
    UserBody,
    Vehicle,
    Vehicles,
)
from advpipe.pipeline.v2x.section import V2x

TAKEN_NAMES = ("clean", "reports")


class Recording(Section):
    """How the bag is written."""

    compression: Literal["none", "lz4", "zstd"] = Field("zstd", description="compression of the bag's chunks")
    markers: Switch = Field(True, description="record boxes as markers for RViz and Foxglove, too")


class Scenario(Section):
    """A scenario file, which describes one drive."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=80)
    description: str = Field("", max_length=100_000)
    simulation: Simulation = Simulation()
    map: Map
    traffic: Traffic = Traffic()
    trajectories: Trajectories | None = Field(None, description="vehicles that follow given trajectories")
    vehicles: Vehicles = Field(
        {"ego": Vehicle()}, max_length=200, description="instrumented vehicles by name"
    )
    bodies: dict[Name, UserBody] = Field(
        {}, max_length=1000, description="bodies of your own by name, for `mix` and `vehicles`"
    )
    sensors: Sensors = Sensors()
    environment: Environment = Environment()
    world: Implementation = Field(
        "raycast", description="simulator of what sensors see: raycast, or module:Class of your own"
    )
    v2x: V2x = V2x()
    recording: Recording = Recording()
    attacks: Attacks = Field(
        {}, max_length=1000, description="adversarial bags that `advpipe run` makes of the drive, by name"
    )

    @model_validator(mode="after")
    def _bodies(self) -> Scenario:
        clashes = sorted(set(self.bodies) & {*BODIES, *PEOPLE})
        if clashes:
            raise ValueError(f"bodies.{clashes[0]} has the name of a built-in body; rename it")
        known = (*BODIES, *self.bodies)
        for place, body in (
            *((f"traffic.mix.{body}", body) for body in self.traffic.mix),
            *(
                (f"vehicles.{name}.body {vehicle.body!r}", vehicle.body)
                for name, vehicle in self.vehicles.items()
            ),
        ):
            if body not in known:
                raise ValueError(f"{place} is not a known body; {known_names(body, known)}")
        return self

    @model_validator(mode="after")
    def _carriers(self) -> Scenario:
        if not self.vehicles:
            raise ValueError("vehicles is empty; name at least one, like ego: {}")
        for place, _, sensor in self.sensors.mounted():
            if sensor.vehicle not in self.vehicles:
                known = ", ".join(sorted(self.vehicles))
                raise ValueError(
                    f"sensors.{place}.vehicle {sensor.vehicle!r} is not one of the vehicles ({known})"
                )
        self.sensors.check(self.simulation.step_s)
        for name, vehicle in self.vehicles.items():
            if vehicle.driver == "trajectory" and self.trajectories is None:
                raise ValueError(f"vehicles.{name}.driver is trajectory, but there is no trajectories.file")
        return self

    @model_validator(mode="after")
    def _size(self) -> Scenario:
        check_size(self)
        return self

    @model_validator(mode="after")
    def _attacks(self) -> Scenario:
        for name, specs in self.attacks.items():
            if name in TAKEN_NAMES:
                raise ValueError(f"attacks.{name} has a name that data sets reserve; rename it")
            for spec in specs:
                place = f"attacks.{name}: {spec.type}"
                if spec.victim is not None and spec.victim not in self.vehicles:
                    known = ", ".join(sorted(self.vehicles))
                    raise ValueError(
                        f"{place} names the victim {spec.victim!r}, which is not one of the vehicles "
                        f"({known})"
                    )
                if spec.schedule.from_s >= self.simulation.duration_s:
                    raise ValueError(
                        f"{place} begins at {spec.schedule.from_s:g} s, but the recording ends at "
                        f"{self.simulation.duration_s:g} s"
                    )
        return self

    @model_validator(mode="after")
    def _local_dynamic_maps(self) -> Scenario:
        if self.v2x.ldm.rate_hz is not None:
            steps = 1 / self.v2x.ldm.rate_hz / self.simulation.step_s
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-6:
                raise ValueError(
                    f"v2x.ldm.rate_hz {self.v2x.ldm.rate_hz:g} makes {1 / self.v2x.ldm.rate_hz:g} s between "
                    f"snapshots, which is not a multiple of simulation.step_s {self.simulation.step_s:g}"
                )
        return self
