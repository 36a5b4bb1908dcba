"""Traffic without a simulator: only the vehicles of the user's table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.trajectories.trajectories import TrajectoryPlayer


class TrajectoryTraffic(TrafficSource):
    """Plays a table of trajectories; no vehicle reacts to another. The pose of a pushed vehicle replaces
    the table's."""

    def __init__(
        self, scenario: Scenario, network: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
    ) -> None:
        for name, vehicle in scenario.vehicles.items():
            if vehicle.driver != "trajectory":
                raise AdvpipeError(
                    f"vehicles.{name}.driver is {vehicle.driver}, but traffic.source is trajectories, where "
                    f"the table moves all vehicles; set it to trajectory, or traffic.source to sumo"
                )
        self._trajectories = TrajectoryPlayer(scenario, variants)
        self._step_s = scenario.simulation.step_s
        self._next_frame = 0
        self._pushed: dict[str, RoadUser] = {}
        self._now: dict[str, RoadUser] = {}

    def step(self) -> None:
        time_s = round(self._next_frame * self._step_s, 9)
        self._now = {**self._trajectories.at(time_s), **self._pushed}
        self._next_frame, self._pushed = self._next_frame + 1, {}

    def road_users(self) -> dict[str, RoadUser]:
        return self._now

    def route_m(self, name: str) -> Float64:
        return self._trajectories.places_m(name)

    def push(self, users: Iterable[RoadUser], upcoming: Iterable[RoadUser] = ()) -> None:
        self._pushed |= {user.id: user for user in users}
