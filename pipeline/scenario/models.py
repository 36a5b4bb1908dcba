"""The scenario file as a whole: its sections, and the checks across them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.section import Implementation, Name, Number, Section, Switch
from advpipe.pipeline.messages.topic_names import CARLA_ROS_BRIDGE
from advpipe.pipeline.scenario.artery import Artery
from advpipe.pipeline.scenario.attacks import Attacks
from advpipe.pipeline.scenario.carla import Carla
from advpipe.pipeline.scenario.environment import Environment
from advpipe.pipeline.scenario.map import Map
from advpipe.pipeline.scenario.mistake import Mistake, SeveralMistakesError
from advpipe.pipeline.scenario.sensors import Sensors
from advpipe.pipeline.scenario.simulation import Simulation
from advpipe.pipeline.scenario.size import check_size
from advpipe.pipeline.scenario.traffic import (
    ANY_CAR,
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
    names: Literal["advpipe", "carla_ros_bridge"] = Field(
        "advpipe",
        description="names of the topics that `play` and `simulate --live` publish; the bag keeps advpipe's",
    )
    split_s: Number | None = Field(
        None,
        ge=0.1,
        le=1e6,
        description="length of each file of the bag in simulated seconds; null: the bag is one file",
    )
    split_mb: Number | None = Field(
        None,
        ge=0.001,
        le=1e6,
        description="most megabytes of messages in each file, before compression; null: no limit",
    )

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without limits that are not set, and names that are advpipe's own: older drives are recorded with
        the same bytes."""
        tree: dict[str, Any] = handler(self)
        unused = {"names": "advpipe", "split_s": None, "split_mb": None}
        return {key: each for key, each in tree.items() if key not in unused or each != unused[key]}


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
        "raycast", description="simulator of what sensors see: raycast, carla, or module:Class of your own"
    )
    carla: Carla = Carla()
    v2x: V2x = V2x()
    artery: Artery = Artery()
    recording: Recording = Recording()
    attacks: Attacks = Field(
        {}, max_length=1000, description="adversarial bags that `advpipe run` makes of the drive, by name"
    )

    @model_validator(mode="after")
    def _sections_fit(self) -> Scenario:
        checks = (self._bodies(), self._carriers(), self._attacks(), self._local_dynamic_maps())
        if found := [mistake for check in checks for mistake in check]:
            raise SeveralMistakesError(found)
        self.sensors.check(self.simulation.step_s)
        names, step_s = self.recording.names, self.simulation.step_s
        has_semantic = self.world == "carla" and names == CARLA_ROS_BRIDGE
        self.sensors.check_names(self.vehicles, names, step_s, has_semantic)
        check_size(self)
        return self

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without the section of a server that is not used: older drives are recorded with the same bytes."""
        tree: dict[str, Any] = handler(self)
        if self.world != "carla" and self.carla == Carla():
            tree.pop("carla", None)
        if self.v2x.network != "artery" and self.artery == Artery():
            tree.pop("artery", None)
        return tree

    def _bodies(self) -> Iterator[Mistake]:
        for clash in sorted(set(self.bodies) & {ANY_CAR, *BODIES, *PEOPLE}):
            yield (), f"bodies.{clash} has the name of a built-in body; rename it"
        known = (*BODIES, *self.bodies)
        for place, body in (
            *((f"traffic.mix.{body}", body) for body in self.traffic.mix if body != ANY_CAR),
            *(
                (f"vehicles.{name}.body {vehicle.body!r}", vehicle.body)
                for name, vehicle in self.vehicles.items()
            ),
        ):
            if body not in known:
                yield (), f"{place} is not a known body; {known_names(body, known)}"

    def _carriers(self) -> Iterator[Mistake]:
        if not self.vehicles:
            if not self.v2x.enabled:
                yield (), "vehicles is empty and V2X is off, so nothing is recorded; name one, like ego: {}"
            return
        known = ", ".join(sorted(self.vehicles))
        for place, _, sensor in self.sensors.mounted():
            if sensor.vehicle not in self.vehicles:
                yield (), f"sensors.{place}.vehicle {sensor.vehicle!r} is not one of the vehicles ({known})"
        for name, vehicle in self.vehicles.items():
            if vehicle.driver == "trajectory" and self.trajectories is None:
                yield (), f"vehicles.{name}.driver is trajectory, but there is no trajectories.file"
            if vehicle.driver == "carla" and self.world != "carla":
                yield (), f"vehicles.{name}.driver is carla, but world is {self.world}; set world to carla"

    def _attacks(self) -> Iterator[Mistake]:
        known, end_s = ", ".join(sorted(self.vehicles)), self.simulation.duration_s
        for name, specs in self.attacks.items():
            if name in TAKEN_NAMES:
                yield (), f"attacks.{name} has a name that data sets reserve; rename it"
            for number, spec in enumerate(specs):
                place = ("attacks", name, str(number))
                if spec.victim is not None and self.vehicles and spec.victim not in self.vehicles:
                    victim = f"names the victim {spec.victim!r}, which is not one of the vehicles ({known})"
                    yield place, f"{spec.type} {victim}"
                if spec.schedule.from_s >= end_s:
                    begin = f"begins at {spec.schedule.from_s:g} s"
                    yield place, f"{spec.type} {begin}, but the recording ends at {end_s:g} s"

    def _local_dynamic_maps(self) -> Iterator[Mistake]:
        if self.v2x.ldm.rate_hz is not None:
            steps = 1 / self.v2x.ldm.rate_hz / self.simulation.step_s
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-6:
                yield (
                    (),
                    f"v2x.ldm.rate_hz {self.v2x.ldm.rate_hz:g} makes {1 / self.v2x.ldm.rate_hz:g} s between "
                    f"snapshots, which is not a multiple of simulation.step_s {self.simulation.step_s:g}",
                )
