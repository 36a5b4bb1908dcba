"""SUMO's own vehicles: keeps their number constant, and reroutes those that are stuck."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.bodies import Variant, variants_of
from advpipe.stages.simulate.road_network.network import Edge, RoadNetwork
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection
from advpipe.stages.simulate.traffic.sumo.routes import Routes

SPAWN_DISTANCE_M = 150.0
"""Vehicles that fill up the traffic appear at least this far from every instrumented vehicle."""

STOP_EDGES = 5
"""An instrumented vehicle gets its final stop this many edges before its route's end."""

SHORT_ROUTE_M = 500.0
"""On a route shorter than this, an instrumented vehicle starts from rest, since it must stop in time."""

STRANDED_AFTER_S = 4.0

LEAST_ROOM_M = 2.0
"""Least length of lane for one vehicle, a bicycle's; a standing car takes 7.5 m."""


class Population:
    """Inserts vehicles with random routes longer than the recording, so that a vehicle disappears only where
    its road ends.
    """

    def __init__(
        self,
        sumo: SumoConnection,
        scenario: Scenario,
        network: RoadNetwork,
        variants: Mapping[str, Variant],
        routes: Routes,
        rng: np.random.Generator,
    ) -> None:
        self._sumo = sumo
        self._scenario, self._network, self._variants = scenario, network, variants
        self._routes, self._rng = routes, rng
        simulation = scenario.simulation
        self._check_room()
        fastest_mps = max(edge.speed_mps for edge in network.drivable)
        self._route_length_m = 1.2 * fastest_mps * (simulation.warmup_s + simulation.duration_s) + 500.0
        self._added = 0
        self._waited_s: dict[str, float] = {}

    def _check_room(self) -> None:
        """Raise AdvpipeError for more vehicles than fit on the lanes: SUMO would retry the rest in every
        step."""
        lanes_m = sum(
            edge.length_m * sum(lane.for_cars for lane in edge.lanes) for edge in self._network.drivable
        )
        wanted, most = self._scenario.traffic.vehicles, int(lanes_m / LEAST_ROOM_M)
        if wanted > most:
            raise AdvpipeError(
                f"traffic.vehicles is {wanted}; the {lanes_m / 1000:.1f} km of lanes hold at most {most}, "
                f"bumper to bumper; lower it, or choose a larger map"
            )

    def insert_instrumented(self, name: str) -> None:
        """Insert an instrumented vehicle, on its configured route or a random one from a wide road."""
        vehicle = self._scenario.vehicles[name]
        if vehicle.route is not None:
            route = self._routes.checked(vehicle.route, f"vehicles.{name}.route")
            lane = "best"
        else:
            start = self._routes.random_wide_start()
            index = self._routes.random_lane(start)
            route, lane = self._routes.random_walk(start, index, self._route_length_m), str(index)
        is_short = sum(self._network.edges[edge].length_m for edge in route) < SHORT_ROUTE_M
        self._add(name, f"{vehicle.body}.0", route, lane, speed="0" if is_short else "max")
        if vehicle.speed_mps is not None:
            self._sumo.vehicle.setMaxSpeed(name, vehicle.speed_mps)

    def fill_up(self, others: Collection[str], keep_away_m: Sequence[Float64]) -> None:
        """Insert missing vehicles, not counting `others`, none within `SPAWN_DISTANCE_M` of places (3,)."""
        loaded = set(self._sumo.vehicle.getLoadedIDList())
        missing = self._scenario.traffic.vehicles - len(loaded - set(others))
        if missing <= 0:
            return
        shares = self._scenario.traffic.shares
        bodies, weights = list(shares), np.array(list(shares.values()))
        for _ in range(missing):
            body = bodies[int(self._rng.choice(len(bodies), p=weights))]
            names = variants_of(self._variants, body)
            variant = names[int(self._rng.integers(len(names)))]
            edge = self._routes.random_start()
            lane = self._routes.random_lane(edge)
            share = float(self._rng.random())
            route = self._routes.random_walk(edge, lane, self._route_length_m)
            name = self._new_name(body, loaded, others)
            if not keep_away_m:
                self._add(name, variant, route, str(lane))
            elif self._is_away(edge, lane, share, keep_away_m):
                self._add(name, variant, route, str(lane), share * edge.length_m)

    def free_stranded(self, names: Collection[str], elapsed_s: float) -> None:
        """Reroute vehicles that stand on a lane off their route, so that they continue along that lane.

        Otherwise, a vehicle that finds no gap to the lane that it needs blocks its own lane for ever.
        elapsed_s: since the previous call.
        """
        vehicle = self._sumo.vehicle
        for name in names:
            if vehicle.getSpeed(name) > 0.1:
                self._waited_s.pop(name, None)
                continue
            self._waited_s[name] = self._waited_s.get(name, 0.0) + elapsed_s
            lane_id = vehicle.getLaneID(name)
            if self._waited_s[name] < STRANDED_AFTER_S or not lane_id:
                continue
            if not any(lane == lane_id and offset for lane, _, _, offset, *_ in vehicle.getBestLanes(name)):
                continue
            self._waited_s.pop(name)
            edge_id, _, index = lane_id.rpartition("_")
            route = [vehicle.getRoute(name)[vehicle.getRouteIndex(name)]]
            edge, lane = self._network.edges.get(edge_id), int(index)
            if edge is not None and any(link.from_lane == lane for link in edge.connections):
                route = self._routes.random_walk(edge, lane, self._route_length_m, keep_lane=True)
                vehicle.setRoute(name, route)

    def stop_at_the_end(self, name: str) -> None:
        """Stop an instrumented vehicle at its route's end, so that SUMO does not remove it there.

        SUMO stops at the route's first visit to the stop's edge, so the stop is set before the last visit.
        """
        vehicle = self._sumo.vehicle
        ahead = vehicle.getRoute(name)[max(vehicle.getRouteIndex(name), 0) :]
        if len(ahead) > STOP_EDGES or ahead.count(ahead[-1]) > 1 or vehicle.getStops(name, 1):
            return
        edge = self._network.edges[ahead[-1]]
        stop_m = max(edge.length_m - 1.0, 0.5 * edge.length_m)
        with suppress(*self._sumo.refusals):  # too close to brake
            vehicle.setStop(name, edge.id, pos=stop_m, laneIndex=edge.car_lane, duration=1e6)

    def _add(
        self,
        name: str,
        variant: str,
        route: list[str],
        lane: str,
        position_m: float | None = None,
        speed: str = "max",
    ) -> None:
        if f"route.{name}" not in self._sumo.route.getIDList():
            self._sumo.route.add(f"route.{name}", route)
        self._sumo.vehicle.add(
            name,
            f"route.{name}",
            typeID=variant,
            departLane=lane,
            departPos="random_free" if position_m is None else f"{position_m:.2f}",
            departSpeed=speed,
        )

    def _new_name(self, body: str, loaded: set[str], others: Collection[str]) -> str:
        while True:
            self._added += 1
            name = f"{body}.{self._added}"
            if name not in loaded and name not in others:
                return name

    @staticmethod
    def _is_away(edge: Edge, lane: int, share: float, places_m: Sequence[Float64]) -> bool:
        line = edge.lanes[lane].centre_m
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        here = np.array([np.interp(share * along[-1], along, line[:, axis]) for axis in range(2)])
        return all(np.linalg.norm(here - place[:2]) > SPAWN_DISTANCE_M for place in places_m)
