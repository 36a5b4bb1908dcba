"""Traffic by SUMO, both ways: it drives the vehicles, or follows those that are moved from outside."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.controllers import Controllers
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.errors import sumo_errors
from advpipe.stages.simulate.traffic.sumo.own_traffic import own_traffic
from advpipe.stages.simulate.traffic.sumo.population import SPAWN_DISTANCE_M, Population
from advpipe.stages.simulate.traffic.sumo.puppets import Puppets
from advpipe.stages.simulate.traffic.sumo.routes import Routes
from advpipe.stages.simulate.traffic.sumo.vehicle_types import vehicle_types_xml
from advpipe.stages.simulate.traffic.sumo.vehicles import SumoVehicles
from advpipe.stages.simulate.traffic.trajectories.trajectories import Trajectories

__all__ = ["SPAWN_DISTANCE_M", "Traffic"]

INSERTION_LIMIT_S = 120.0
CLEARANCE_M = 10.0
"""Vehicles of SUMO's this near to one that is moved from outside are gone when the recording starts."""


class Traffic:
    """The SUMO simulation of one scenario; a context manager, since only one can run in a process.

    The V2X clock is the master: it calls `step()` once for each of its steps, and SUMO advances by
    `simulation.step_s`. The first `step()` after entering leads to the recording's time 0.

    Lanes are divided laterally, so that a lane change is a drive across and not a jump. Vehicles that are
    moved from outside (rows of a trajectory file, or a controller of their own) have images in SUMO, to
    which its traffic reacts; what `road_users` says of them comes from outside, not from SUMO.
    """

    def __init__(
        self, scenario: Scenario, network: RoadNetwork, variants: dict[str, Variant], scratch: Path
    ) -> None:
        self._scenario, self._network = scenario, network
        rng = named_generator(scenario.simulation.seed, "traffic")
        self._routes = Routes(network, rng)
        self._population = Population(scenario, network, variants, self._routes, rng)
        self._trajectories = Trajectories(scenario, variants)
        for name, vehicle in scenario.vehicles.items():
            if vehicle.route is not None:
                self._routes.checked(vehicle.route, f"vehicles.{name}.route")
        types = scratch / "vehicle_types.add.xml"
        types.write_text(vehicle_types_xml(variants), encoding="utf-8")
        self._own = own_traffic(scenario, network, self._routes, types, self._trajectories.ids)
        self._options = self._own.options(types)
        self._puppets = Puppets(network)
        self._controllers = Controllers(scenario, network, self._puppets)
        self._moved: dict[str, RoadUser] = {}  # who is moved from outside, as they are now
        self._sumo = SumoVehicles(network, variants, scenario.simulation.seed)
        self._steps = 0
        self._frame: int | None = None  # the next frame of the recording; none in the warm-up

    def __enter__(self) -> Traffic:
        import libsumo

        simulation = self._scenario.simulation
        command = ["sumo", "--net-file", str(self._network.sumo_file), *self._options]
        command += ["--seed", str(simulation.seed % 2**31), "--step-length", str(simulation.step_s)]
        command += ["--lateral-resolution", "0.8", "--time-to-teleport", "-1", "--collision.action", "none"]
        command += ["--no-step-log", "--no-warnings", "--default.speeddev", "0.1", "--max-depart-delay", "2"]
        with sumo_errors():
            libsumo.start(command)
        try:
            with sumo_errors():
                self._warm_up()
        except BaseException:
            libsumo.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        import libsumo

        libsumo.close()

    def step(self) -> None:
        """Advances everybody by one step, and replaces vehicles whose road has ended."""
        with sumo_errors():
            self._advance()
            self._check_instrumented()
            self._fill_up([self._position_m(name) for name in self._scenario.vehicles])

    def road_users(self) -> dict[str, RoadUser]:
        """Every vehicle that is on the road now, by id, SUMO's first.

        Velocities are in the map's frame, with their vertical part; SUMO's vehicles move where they look.
        """
        return {**self._sumo.now(self._puppets.images), **self._moved}

    def route_m(self, name: str) -> Float64:
        """The middle of the way along a vehicle's whole route (K, 3)."""
        import libsumo

        driver = self._scenario.vehicles[name].driver if name in self._scenario.vehicles else "traffic"
        if driver == "trajectory":
            return self._trajectories.places_m(name)
        if driver == "controller":
            return self._controllers.path_m(name)
        edges = [self._network.edges[edge] for edge in libsumo.vehicle.getRoute(name)]
        return np.concatenate([edge.lanes[0].centre_m for edge in edges])

    def _warm_up(self) -> None:
        import libsumo

        simulation = self._scenario.simulation
        inserted_by_us = {
            name for name, vehicle in self._scenario.vehicles.items() if vehicle.driver != "trajectory"
        }
        waited_s = 0.0
        self._fill_up([])
        while waited_s < simulation.warmup_s or not inserted_by_us <= set(libsumo.vehicle.getIDList()):
            if waited_s > simulation.warmup_s + INSERTION_LIMIT_S:
                raise AdvpipeError(
                    f"no room on the network for {', '.join(sorted(inserted_by_us))} within "
                    f"{INSERTION_LIMIT_S:g} s; lower traffic.vehicles"
                )
            self._advance()
            self._fill_up([])
            waited_s += simulation.step_s
        self._frame = 0
        first = self._trajectories.at(0.0)
        self._make_way(first)
        self._puppets.announce(first.values())
        self._advance_sumo()

    def _advance(self) -> None:
        """One step of everybody."""
        moved = self._controllers.step(self.road_users()) if self._controllers else {}
        upcoming: dict[str, RoadUser] = {}
        if self._frame is not None:
            moved |= self._trajectories.at(self._time_s(self._frame))
            upcoming = self._trajectories.at(self._time_s(self._frame + 1))
            self._frame += 1
        self._puppets.move(moved)
        self._puppets.announce(user for name, user in upcoming.items() if name not in moved)
        self._advance_sumo()
        self._puppets.set_speeds(moved)
        self._moved = moved

    def _advance_sumo(self) -> None:
        import libsumo

        libsumo.simulationStep()
        self._steps += 1
        step_s = self._scenario.simulation.step_s
        every = max(round(1.0 / step_s), 1)
        if self._steps % every == 0:
            self._population.free_stranded(self._rerouted(), every * step_s)
            present = set(libsumo.vehicle.getIDList())
            for name, vehicle in self._scenario.vehicles.items():
                if vehicle.driver == "traffic" and name in present:
                    self._population.stop_at_the_end(name)

    def _time_s(self, frame: int) -> float:
        return round(frame * self._scenario.simulation.step_s, 9)

    def _fill_up(self, keep_away_m: list[Float64]) -> None:
        import libsumo

        loaded = libsumo.vehicle.getLoadedIDList()
        for name, vehicle in self._scenario.vehicles.items():
            if vehicle.driver != "trajectory" and name not in loaded:
                self._population.insert_instrumented(name)
        if not self._own.is_users:
            others = {*self._scenario.vehicles, *self._trajectories.ids}
            self._population.fill_up(others, keep_away_m)

    def _check_instrumented(self) -> None:
        import libsumo

        present = {*libsumo.vehicle.getIDList(), *self._moved}
        for name in self._scenario.vehicles:
            if name not in present:
                raise AdvpipeError(
                    f"{name} came to the end of its road too fast to stop there; "
                    f"give vehicles.{name}.route a longer one, or choose another simulation.seed"
                )

    def _make_way(self, first: dict[str, RoadUser]) -> None:
        import libsumo

        for name, user in self._sumo.now(self._puppets.images).items():
            if name in self._scenario.vehicles:
                continue
            for other in first.values():
                room_m = CLEARANCE_M + (user.variant.length_m + other.variant.length_m) / 2
                if np.linalg.norm(user.position_m - other.position_m) < room_m:
                    libsumo.vehicle.remove(name)
                    break

    def _rerouted(self) -> list[str]:
        """Vehicles that follow routes which we drew."""
        import libsumo

        fixed = {
            name
            for name, vehicle in self._scenario.vehicles.items()
            if vehicle.driver != "traffic" or vehicle.route is not None
        }
        fixed |= self._puppets.images
        present = libsumo.vehicle.getIDList()
        if self._own.is_users:
            present = [name for name in present if name in self._scenario.vehicles]
        return [name for name in present if name not in fixed]

    def _position_m(self, name: str) -> Float64:
        return self._moved[name].position_m if name in self._moved else self._sumo.position_m(name)
