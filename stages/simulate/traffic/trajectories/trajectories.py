"""The user's trajectories: states of the vehicles in the user's table at any time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64, se3, se3_from_yaw
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant, variants_of
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.trajectories.table import Rows, read_trajectory_table

ROUNDING_S = 1e-6
"""Tolerance within which times of steps and rows are equal."""


@dataclass(frozen=True)
class Trajectory:
    """The trajectory of one vehicle, which exists from `times_s[0]` to `times_s[-1]`.

    places_m: (K, 3) of base_link in the map's frame. angles_rad: (K, 3) yaw, pitch, roll, unwrapped.
    velocities_mps: (K, 3), by central differences of the places.
    """

    id: str
    variant: Variant
    times_s: Float64
    places_m: Float64
    angles_rad: Float64
    velocities_mps: Float64

    @classmethod
    def of(cls, name: str, variant: Variant, rows: Rows) -> Trajectory:
        """The trajectory of one id from its rows."""
        times_s, places_m, angles_rad = rows.values[:, 0], rows.values[:, 1:4], rows.values[:, 4:7]
        velocities_mps = np.gradient(places_m, times_s, axis=0)
        return cls(name, variant, times_s, places_m, np.unwrap(angles_rad, axis=0), velocities_mps)

    def exists_at(self, time_s: float) -> bool:
        """Whether the vehicle exists at a time since the recording's start."""
        return bool(self.times_s[0] - ROUNDING_S <= time_s <= self.times_s[-1] + ROUNDING_S)

    def at(self, time_s: float) -> RoadUser:
        """The vehicle at a time; place, angles and velocity are interpolated linearly between rows."""
        columns = np.concatenate([self.places_m, self.angles_rad, self.velocities_mps], axis=1)
        last = len(self.times_s) - 2
        index = min(max(int(np.searchsorted(self.times_s, time_s, side="right")) - 1, 0), last)
        start_s, end_s = self.times_s[index], self.times_s[index + 1]
        share = min(max((time_s - start_s) / (end_s - start_s), 0.0), 1.0)
        now = columns[index] * (1 - share) + columns[index + 1] * share
        pose = se3_from_yaw(now[:3], now[3], now[4]) @ _roll(now[5])
        return RoadUser(self.id, self.variant, pose, now[6:9])


class TrajectoryPlayer:
    """All vehicles that a table of trajectories moves; none if the scenario names no table."""

    def __init__(self, scenario: Scenario, variants: Mapping[str, Variant]) -> None:
        self._trajectories: list[Trajectory] = []
        if scenario.trajectories is None:
            return
        path = Path(scenario.trajectories.file)
        bodies = frozenset(variant.body.name for variant in variants.values())
        table = read_trajectory_table(path, bodies)
        for name, rows in table.items():
            _check_name(scenario, name, path)
            self._trajectories.append(Trajectory.of(name, _variant(scenario, variants, name, rows), rows))
        last_s = (scenario.simulation.frames - 1) * scenario.simulation.step_s
        for name, vehicle in scenario.vehicles.items():
            if vehicle.driver != "trajectory":
                continue
            if name not in table:
                raise AdvpipeError(
                    f"vehicles.{name}.driver is trajectory, but {path} has no row of id {name}"
                )
            first_row_s, last_row_s = table[name].values[[0, -1], 0]
            if first_row_s > ROUNDING_S or last_row_s < last_s - ROUNDING_S:
                raise AdvpipeError(
                    f"{path}: {name} carries sensors but has rows only from {first_row_s:g} s to "
                    f"{last_row_s:g} s of a recording from 0 s to {last_s:g} s; "
                    f"shorten simulation.duration_s or add rows"
                )

    @property
    def ids(self) -> frozenset[str]:
        """Every id in the table."""
        return frozenset(trajectory.id for trajectory in self._trajectories)

    def at(self, time_s: float) -> dict[str, RoadUser]:
        """The vehicles that exist at a time since the recording's start, by id."""
        return {each.id: each.at(time_s) for each in self._trajectories if each.exists_at(time_s)}

    def places_m(self, name: str) -> Float64:
        """All places (K, 3) of one id."""
        return next(each.places_m for each in self._trajectories if each.id == name)


def _check_name(scenario: Scenario, name: str, path: Path) -> None:
    vehicle = scenario.vehicles.get(name)
    if vehicle is not None and vehicle.driver != "trajectory":
        raise AdvpipeError(
            f"{path} has rows of {name}, whose driver is {vehicle.driver}; rename the id, "
            f"or set vehicles.{name}.driver to trajectory"
        )
    prefix, _, number = name.rpartition(".")
    reserved = {"pedestrian": scenario.traffic.pedestrians, "parked": scenario.traffic.parked_per_km}
    if number.isdigit() and reserved.get(prefix):
        key = "pedestrians" if prefix == "pedestrian" else "parked_per_km"
        raise AdvpipeError(f"{path}: {name} is a reserved name; rename the id or set traffic.{key} to 0")


def _variant(scenario: Scenario, variants: Mapping[str, Variant], name: str, rows: Rows) -> Variant:
    """The variant: for an instrumented vehicle, of its body in the scenario, else of its body in the
    table."""
    if name in scenario.vehicles:
        return variants[f"{scenario.vehicles[name].body}.0"]
    choices = variants_of(variants, rows.body)
    rng = named_generator(scenario.simulation.seed, "trajectories", name)
    return variants[choices[int(rng.integers(len(choices)))]]


def _roll(roll_rad: float) -> Float64:
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    return se3([[1, 0, 0], [0, c, -s], [0, s, c]], [0, 0, 0])
