"""The vehicle with a controller of its own: follows its lane, its leader, the lights and the slope."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.controller import CURVE_MPS2, Controller, Idm
from advpipe.stages.simulate.traffic.lane_path import LanePath, lane_path
from advpipe.stages.simulate.traffic.road_users import RoadUser

Driver = Callable[[Scenario, int], list[dict[str, RoadUser]]]


def path_of(places_m: np.ndarray, limit_mps: float = 14.0, lights: tuple = ()) -> LanePath:
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(places_m, axis=0), axis=1))])
    return LanePath(places_m, along, np.full(len(along), limit_mps), lights)


def straight(length_m: int, slope: float = 0.0) -> np.ndarray:
    x = np.arange(length_m + 1.0)
    return np.column_stack([x, 0 * x, slope * x])


def run(controller: Controller, steps: int, others: list[RoadUser], light: str = "G") -> list[RoadUser]:
    return [controller.step(0.1, others, lambda name, index: light) for _ in range(steps)]


def test_idm_at_rest_behind_a_leader_and_on_a_free_road() -> None:
    """By hand from eq. 3: none at v0, a from rest, none at the gap s* / sqrt(1 - (v/v0)^4)."""
    idm = Idm()
    assert idm(20.0, 20.0, np.inf, 0.0) == pytest.approx(0)
    assert idm(0.0, 20.0, np.inf, 0.0) == pytest.approx(1.4)
    equilibrium_m = (2.0 + 1.2 * 10) / np.sqrt(1 - 0.5**4)
    assert idm(10.0, 20.0, equilibrium_m, 10.0) == pytest.approx(0, abs=1e-9)
    # closing in at 5 m/s: s* = 2 + 12 + 10 * 5 / (2 sqrt(2.8)) = 28.94 m, at 40 m
    assert idm(10.0, 20.0, 40.0, 5.0) == pytest.approx(1.4 * (1 - 0.0625 - (28.940 / 40) ** 2), abs=1e-3)


def test_it_reaches_its_speed_on_the_centre_line(variants: dict[str, Variant]) -> None:
    start = se3_from_yaw([5.0, 1.0, 0], 0.1)  # a metre beside, askew
    users = run(Controller("ego", variants["sedan.0"], path_of(straight(600)), start, 50.0), 300, [])
    assert abs(users[-1].position_m[1]) < 0.05
    assert np.linalg.norm(users[-1].velocity_mps) == pytest.approx(14.0, abs=0.3)


def test_velocity_matches_the_displacement(variants: dict[str, Variant]) -> None:
    """On a climbing bend of 40 m radius, where its middle moves sideways too."""
    angle = np.arange(0, 4.0, 1 / 40)
    bend = np.column_stack([40 * np.sin(angle), 40 - 40 * np.cos(angle), 2.0 * angle])
    controller = Controller("ego", variants["sedan.0"], path_of(bend), se3_from_yaw([2, 0, 0], 0.05), 50.0)
    users = run(controller, 120, [])
    for before, after in pairwise(users[30:]):
        moved_mps = (after.position_m - before.position_m) / 0.1
        mean_mps = (before.velocity_mps + after.velocity_mps) / 2
        assert moved_mps[:2] == pytest.approx(mean_mps[:2], abs=0.1)
        assert moved_mps[2] == pytest.approx(mean_mps[2], abs=0.1)
    radius_m = [np.linalg.norm(user.position_m[:2] - [0, 40]) for user in users[30:]]
    assert np.abs(np.array(radius_m) - 40).max() < 0.6
    fastest_mps = max(np.linalg.norm(user.velocity_mps) for user in users)
    assert fastest_mps == pytest.approx(np.sqrt(CURVE_MPS2 * 40), rel=0.1)


def test_pitch_and_height_are_those_of_the_slope(variants: dict[str, Variant]) -> None:
    controller = Controller(
        "ego", variants["bus.0"], path_of(straight(400, 0.04)), se3_from_yaw([10, 0, 0.4], 0), 50.0
    )
    for user in run(controller, 100, []):
        assert user.position_m[2] == pytest.approx(0.04 * user.position_m[0], abs=0.01)
        assert user.map_SE3_base[2, 0] == pytest.approx(np.sin(np.arctan(0.04)), abs=1e-3)
        assert user.velocity_mps[2] == pytest.approx(0.04 * user.velocity_mps[0], abs=1e-2)


@pytest.mark.parametrize("beside_m", [0.0, 3.4])
def test_it_stops_behind_vehicles_in_its_lane_and_passes_others(
    variants: dict[str, Variant], beside_m: float
) -> None:
    sedan = variants["sedan.0"]
    wall = RoadUser("wall", sedan, se3_from_yaw([200, beside_m, 0], 0), np.zeros(3))
    users = run(
        Controller("ego", sedan, path_of(straight(300)), se3_from_yaw([5, 0, 0], 0), 50.0), 400, [wall]
    )
    if beside_m:
        assert users[-1].position_m[0] > 280
    else:
        gap_m = 200 - users[-1].position_m[0] - sedan.length_m
        assert 1.0 < gap_m < 3.0
        assert np.linalg.norm(users[-1].velocity_mps) < 0.1


def test_it_stops_at_red_and_drives_at_green(variants: dict[str, Variant]) -> None:
    sedan = variants["sedan.0"]
    path = path_of(straight(300), lights=((100.0, "x", 0),))
    controller = Controller("ego", sedan, path, se3_from_yaw([5, 0, 0], 0), 50.0)
    held = run(controller, 250, [], "r")[-1].position_m[0] + sedan.length_m / 2
    assert 96 < held <= 100
    assert run(controller, 250, [], "G")[-1].position_m[0] > 250


def test_it_stops_at_the_end_of_its_path(variants: dict[str, Variant]) -> None:
    sedan = variants["sedan.0"]
    users = run(Controller("ego", sedan, path_of(straight(150)), se3_from_yaw([5, 0, 0], 0), 50.0), 400, [])
    assert 145 < users[-1].position_m[0] + sedan.length_m / 2 <= 150


def test_a_path_keeps_to_lanes_and_changes_them_smoothly(tmp_path: Path, road: Callable[..., Path]) -> None:
    network = load_network(load_scenario("smoke", [f"map.sumo_net={road(400, lanes=2)}"]).map, tmp_path)
    for lane in (0, 1):
        path = lane_path(network, ["ab", "bc"], lane)
        assert path.along_m[-1] == pytest.approx(600, abs=1)
        apart = [np.abs(path.places_m[:, 1] - y).min() for y in (-1.6, -4.8)]
        assert min(apart) < 1e-6
        assert np.abs(np.diff(path.places_m[:, 1])).max() < 0.15


def test_it_drives_among_sumos_traffic(tmp_path: Path, drive: Driver, variants: dict[str, Variant]) -> None:
    """A minute on the boulevard: it advances without collisions, and its true motion is smooth."""
    settings = ["vehicles={ego: {driver: controller}}", "traffic.vehicles=60", "simulation.duration_s=60"]
    states = drive(load_scenario("boulevard", [*settings, "simulation.warmup_s=5"]), 600)
    egos = [state["ego"] for state in states]
    steps_m = [float(np.linalg.norm(b.position_m - a.position_m)) for a, b in pairwise(egos)]
    assert sum(steps_m) > 150
    assert max(steps_m) < 1.6
    for state in states[::5]:
        ego = state["ego"]
        for name, user in state.items():
            if name != "ego":
                apart_m = np.linalg.norm(user.position_m - ego.position_m)
                assert apart_m > 1.0, name
