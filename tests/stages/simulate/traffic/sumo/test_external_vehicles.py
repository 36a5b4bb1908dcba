"""Vehicles that are pushed into SUMO's traffic: their poses are exact, traffic reacts to them, and they
disappear when no longer pushed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.road_users import RoadUser

SETTINGS = ["traffic.vehicles=0", "simulation.warmup_s=1", "vehicles={ego: {route: [ab, bc]}}"]


@pytest.mark.parametrize("beside_m", [0.0, 60.0])
def test_traffic_stops_behind_a_pushed_vehicle(
    tmp_path: Path, road: Callable[..., Path], variants: dict[str, Variant], beside_m: float
) -> None:
    """A wall on the road stops the ego before its rear; once it is gone, the ego drives on."""
    scenario = load_scenario("smoke", [f"map.sumo_net={road(400)}", *SETTINGS])
    network = load_network(scenario.map, tmp_path)
    wall = RoadUser("wall", variants["sedan.0"], se3_from_yaw([300, beside_m - 1.6, 0], 0), np.zeros(3))
    with open_traffic(scenario, network, variants, tmp_path) as traffic:
        for _ in range(400):
            traffic.push([wall], [wall])
            traffic.step()
            assert traffic.road_users()["wall"] is wall
        place_m = traffic.road_users()["ego"].position_m[0]
        assert (280 < place_m < 300 - 4.5) if beside_m == 0 else place_m > 320
        for _ in range(100):
            traffic.step()
            assert "wall" not in traffic.road_users()
        assert traffic.road_users()["ego"].position_m[0] > 320


def test_pushing_a_vehicle_of_sumo_replaces_it(
    tmp_path: Path, road: Callable[..., Path], variants: dict[str, Variant]
) -> None:
    """As by a simulator of vehicle dynamics that moves the ego: it goes where it is pushed, once."""
    scenario = load_scenario("smoke", [f"map.sumo_net={road(400)}", *SETTINGS])
    network = load_network(scenario.map, tmp_path)
    with open_traffic(scenario, network, variants, tmp_path) as traffic:
        for x_m in np.arange(50.0, 60.0):
            pose, speed_mps = se3_from_yaw([x_m, -1.6, 0], 0), np.array([10.0, 0, 0])
            traffic.push([RoadUser("ego", variants["sedan.0"], pose, speed_mps)])
            traffic.step()
            assert list(traffic.road_users()) == ["ego"]
            assert traffic.road_users()["ego"].position_m[0] == x_m
