"""Traffic by SUMO, which drives vehicles and reacts to externally moved ones."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.protocol import TrafficSource
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection
from advpipe.stages.simulate.traffic.sumo.controlled_vehicles import ControlledVehicles
from advpipe.stages.simulate.traffic.sumo.external_vehicles import ExternalVehicles
from advpipe.stages.simulate.traffic.sumo.joining import prepare_server
from advpipe.stages.simulate.traffic.sumo.population import Population
from advpipe.stages.simulate.traffic.sumo.routes import Routes
from advpipe.stages.simulate.traffic.sumo.signals import signal_states
from advpipe.stages.simulate.traffic.sumo.user_traffic import user_traffic
from advpipe.stages.simulate.traffic.sumo.vehicle_types import vehicle_types_xml
from advpipe.stages.simulate.traffic.sumo.vehicles import SumoVehicles
from advpipe.stages.simulate.traffic.trajectories.trajectories import TrajectoryPlayer

INSERTION_LIMIT_S = 120.0
CLEARANCE_M = 10.0
"""SUMO's vehicles this near to an externally moved one are removed before the recording starts."""


class SumoTraffic(TrafficSource):
    """The SUMO simulation of one scenario; with libsumo, only one can run in a process.

    Lanes are divided laterally, so that vehicles change lanes gradually. Externally moved vehicles (pushed,
    from a trajectory file, or with a controller) have images in SUMO, to which its traffic reacts;
    `road_users` returns their external states, not SUMO's.
    """

    def __init__(
        self, scenario: Scenario, network: RoadNetwork, variants: Mapping[str, Variant], scratch: Path
    ) -> None:
        self._scenario, self._network, self._variants = scenario, network, variants
        rng = named_generator(scenario.simulation.seed, "traffic")
        routes = Routes(network, rng)
        sumo = SumoConnection(scenario.traffic.transport, scenario.traffic.server, scratch)
        self._sumo = sumo
        self._population = Population(sumo, scenario, network, variants, routes, rng)
        self._trajectories = TrajectoryPlayer(scenario, variants)
        for name, vehicle in scenario.vehicles.items():
            if vehicle.route is not None:
                routes.checked(vehicle.route, f"vehicles.{name}.route")
        types = scratch / "vehicle_types.add.xml"
        types.write_text(vehicle_types_xml(variants), encoding="utf-8")
        self._user_traffic = user_traffic(scenario, network, routes, types, self._trajectories.ids)
        self._options = [*_options(scenario, network), *self._user_traffic.options(types)]
        self._external = ExternalVehicles(sumo, network)
        self._controlled = ControlledVehicles(sumo, scenario, network)
        shows_lights = scenario.world == "carla"  # CARLA's vehicles have lamps, the embedded world's do not
        self._vehicles = SumoVehicles(sumo, network, variants, scenario.simulation.seed, shows_lights)
        self._pushed: dict[str, RoadUser] = {}  # for the next step
        self._upcoming: dict[str, RoadUser] = {}  # for the step after it
        self._moved: dict[str, RoadUser] = {}  # current states of externally moved vehicles
        self._steps = self._frame = 0

    def __enter__(self) -> SumoTraffic:
        self._sumo.start(self._options)
        try:
            with self._sumo.errors():
                if self._scenario.traffic.server.join is not None:
                    prepare_server(
                        self._sumo, self._network, self._variants, self._scenario.simulation.step_s
                    )
                self._warm_up()
        except BaseException:
            self._sumo.close(after_error=True)
            raise
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._sumo.close(after_error=error is not None)

    def step(self) -> None:
        """Advance all vehicles by one step, and replace those that have reached the end of their road."""
        step_s = self._scenario.simulation.step_s
        now_s, next_s = (round(frame * step_s, 9) for frame in (self._frame, self._frame + 1))
        self.push(self._trajectories.at(now_s).values(), self._trajectories.at(next_s).values())
        with self._sumo.errors():
            self._advance()
            self._check_instrumented()
            self._fill_up([self._position_m(name) for name in self._present_instrumented()])
        self._frame += 1

    def road_users(self) -> dict[str, RoadUser]:
        """All vehicles now on the road, by id, SUMO's first, whose velocities point along their headings."""
        with self._sumo.errors():
            return {**self._vehicles.now(self._external.images), **self._moved}

    def route_m(self, name: str) -> Float64:
        """The centre line (K, 3) of a vehicle's whole route."""
        driver = self._scenario.vehicles[name].driver
        if driver == "trajectory":
            return self._trajectories.places_m(name)
        if driver == "controller":
            return self._controlled.path_m(name)
        if driver == "carla":
            raise AdvpipeError(f"vehicles.{name} is driven by CARLA, so SUMO knows no route of it")
        with self._sumo.errors():
            edges = [self._network.edges[edge] for edge in self._sumo.vehicle.getRoute(name)]
        return np.concatenate([edge.lanes[0].centre_m for edge in edges])

    def signals(self) -> dict[str, str]:
        """See `SignalisedTraffic`; netconvert calls a signal after its traffic light and link, if the map has
        no name for it."""
        with self._sumo.errors():
            return signal_states(self._sumo)

    def push(self, users: Iterable[RoadUser], upcoming: Iterable[RoadUser] = ()) -> None:
        """Set the external vehicles of the next step, and those of the step after it, for which SUMO makes
        room."""
        self._pushed |= {user.id: user for user in users}
        self._upcoming |= {user.id: user for user in upcoming}

    def _warm_up(self) -> None:
        simulation = self._scenario.simulation
        inserted_by_us = {name for name, vehicle in self._scenario.vehicles.items() if vehicle.is_in_sumo}
        waited_s = 0.0
        self._fill_up([])
        while waited_s < simulation.warmup_s or not inserted_by_us <= set(self._sumo.vehicle.getIDList()):
            if waited_s > simulation.warmup_s + INSERTION_LIMIT_S:
                raise AdvpipeError(
                    f"no room on the network for {', '.join(sorted(inserted_by_us))} within "
                    f"{INSERTION_LIMIT_S:g} s; lower traffic.vehicles"
                )
            self._advance()
            self._fill_up([])
            waited_s += simulation.step_s
        first = self._trajectories.at(0.0)
        self._make_way(first.values())
        self._external.announce(first.values())
        self._simulate_step()

    def _advance(self) -> None:
        """One step of all vehicles."""
        controlled = self._controlled.step(self.road_users()) if self._controlled else {}
        moved, upcoming = {**controlled, **self._pushed}, self._upcoming
        self._pushed, self._upcoming = {}, {}
        self._external.move(moved)
        self._external.announce(user for name, user in upcoming.items() if name not in moved)
        self._simulate_step()
        self._external.set_speeds(moved)
        self._moved = moved

    def _simulate_step(self) -> None:
        self._sumo.simulate_step()
        self._steps += 1
        step_s = self._scenario.simulation.step_s
        every = max(round(1.0 / step_s), 1)
        if self._steps % every == 0:
            self._population.free_stranded(self._rerouted(), every * step_s)
            present = set(self._sumo.vehicle.getIDList())
            for name, vehicle in self._scenario.vehicles.items():
                if vehicle.driver == "traffic" and name in present:
                    self._population.stop_at_the_end(name)

    def _fill_up(self, keep_away_m: Sequence[Float64]) -> None:
        loaded = self._sumo.vehicle.getLoadedIDList()
        for name, vehicle in self._scenario.vehicles.items():
            if vehicle.is_in_sumo and name not in loaded:
                self._population.insert_instrumented(name)
        if not self._user_traffic.is_user_supplied:
            others = {*self._scenario.vehicles, *self._trajectories.ids, *self._external.images}
            self._population.fill_up(others, keep_away_m)

    def _check_instrumented(self) -> None:
        present = {*self._sumo.vehicle.getIDList(), *self._moved}
        for name, vehicle in self._scenario.vehicles.items():
            if name not in present and vehicle.driver != "carla":
                raise AdvpipeError(
                    f"{name} reached the end of its road too fast to stop there; "
                    f"give vehicles.{name}.route a longer one, or choose another simulation.seed"
                )

    def _present_instrumented(self) -> list[str]:
        """The instrumented vehicles that have a place; CARLA's may not have been pushed yet."""
        return [
            name
            for name, vehicle in self._scenario.vehicles.items()
            if vehicle.driver != "carla" or name in self._moved
        ]

    def _make_way(self, first: Collection[RoadUser]) -> None:
        """Remove SUMO's vehicles that are too near to the first externally moved ones."""
        for name, user in self._vehicles.now(self._external.images).items():
            if name in self._scenario.vehicles:
                continue
            for other in first:
                room_m = CLEARANCE_M + (user.variant.length_m + other.variant.length_m) / 2
                if np.linalg.norm(user.position_m - other.position_m) < room_m:
                    self._sumo.vehicle.remove(name)
                    break

    def _rerouted(self) -> list[str]:
        """Ids of the vehicles with random routes, which may be rerouted."""
        fixed = {
            name
            for name, vehicle in self._scenario.vehicles.items()
            if vehicle.driver != "traffic" or vehicle.route is not None
        }
        fixed |= self._external.images
        present = self._sumo.vehicle.getIDList()
        if self._user_traffic.is_user_supplied:
            present = [name for name in present if name in self._scenario.vehicles]
        return [name for name in present if name not in fixed]

    def _position_m(self, name: str) -> Float64:
        return self._moved[name].position_m if name in self._moved else self._vehicles.position_m(name)


def _options(scenario: Scenario, network: RoadNetwork) -> list[str]:
    """SUMO's command-line options, except those for traffic."""
    simulation = scenario.simulation
    command = ["--net-file", str(network.sumo_file)]
    command += ["--seed", str(simulation.seed % 2**31), "--step-length", str(simulation.step_s)]
    command += ["--lateral-resolution", "0.8", "--time-to-teleport", "-1", "--collision.action", "none"]
    command += ["--no-step-log", "--no-warnings", "--default.speeddev", "0.1", "--max-depart-delay", "2"]
    return command
