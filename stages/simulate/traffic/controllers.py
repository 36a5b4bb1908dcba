"""The instrumented vehicles that drive themselves."""

from __future__ import annotations

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.road_network.network import RoadNetwork
from advpipe.stages.simulate.traffic.controller import Controller
from advpipe.stages.simulate.traffic.lane_path import lane_path
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.traffic.sumo.puppets import Puppets


class Controllers:
    """One controller for each vehicle with `driver: controller`; it begins where SUMO found a free place."""

    def __init__(self, scenario: Scenario, network: RoadNetwork, puppets: Puppets) -> None:
        self._scenario, self._network, self._puppets = scenario, network, puppets
        self._names = [name for name, vehicle in scenario.vehicles.items() if vehicle.driver == "controller"]
        self._controllers: dict[str, Controller] = {}

    def __bool__(self) -> bool:
        return bool(self._names)

    def step(self, everybody: dict[str, RoadUser]) -> dict[str, RoadUser]:
        """Where they are one step later, by id, given where everybody is now."""
        import libsumo

        inserted = set(libsumo.vehicle.getIDList())
        for name in self._names:
            if name not in self._controllers and name in inserted:
                self._controllers[name] = self._hand_over(name, everybody[name])
        step_s = self._scenario.simulation.step_s
        return {
            name: controller.step(
                step_s, [user for other, user in everybody.items() if other != name], _light
            )
            for name, controller in self._controllers.items()
        }

    def path_m(self, name: str) -> Float64:
        """The path (K, 3) of one of them."""
        return self._controllers[name].path_m

    def _hand_over(self, name: str, user: RoadUser) -> Controller:
        import libsumo

        route = libsumo.vehicle.getRoute(name)[libsumo.vehicle.getRouteIndex(name) :]
        path = lane_path(self._network, route, libsumo.vehicle.getLaneIndex(name))
        wished_mps = self._scenario.vehicles[name].speed_mps or user.variant.body.max_speed_mps
        self._puppets.adopt(name)
        return Controller(name, user.variant, path, user.map_SE3_base, wished_mps)


def _light(name: str, index: int) -> str:
    import libsumo

    return str(libsumo.trafficlight.getRedYellowGreenState(name)[index])
