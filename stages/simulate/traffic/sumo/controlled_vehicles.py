"""The instrumented vehicles that a controller drives."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.controller import Controller
from advpipe.stages.simulate.traffic.lane_path import lane_path
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.connection import SumoConnection


class ControlledVehicles:
    """One controller for each vehicle with `driver: controller`; it starts where SUMO inserted the
    vehicle."""

    def __init__(self, sumo: SumoConnection, scenario: Scenario, network: RoadNetwork) -> None:
        self._sumo, self._scenario, self._network = sumo, scenario, network
        self._names = [name for name, vehicle in scenario.vehicles.items() if vehicle.driver == "controller"]
        self._controllers: dict[str, Controller] = {}

    def __bool__(self) -> bool:
        return bool(self._names)

    def step(self, road_users: Mapping[str, RoadUser]) -> dict[str, RoadUser]:
        """Advance by one step, given all current road users; return the controlled vehicles by id."""
        inserted = set(self._sumo.vehicle.getIDList())
        for name in self._names:
            if name not in self._controllers and name in inserted:
                self._controllers[name] = self._take_over(name, road_users[name])
        step_s = self._scenario.simulation.step_s
        return {
            name: controller.step(
                step_s, [user for other, user in road_users.items() if other != name], self._light
            )
            for name, controller in self._controllers.items()
        }

    def path_m(self, name: str) -> Float64:
        """The path (K, 3) of a controlled vehicle in the map's frame."""
        return self._controllers[name].path_m

    def _take_over(self, name: str, user: RoadUser) -> Controller:
        vehicle = self._sumo.vehicle
        route = vehicle.getRoute(name)[vehicle.getRouteIndex(name) :]
        path = lane_path(self._network, route, vehicle.getLaneIndex(name))
        desired_mps = self._scenario.vehicles[name].speed_mps or user.variant.body.max_speed_mps
        return Controller(name, user.variant, path, user.map_SE3_base, desired_mps)

    def _light(self, name: str, index: int) -> str:
        return str(self._sumo.trafficlight.getRedYellowGreenState(name)[index])
