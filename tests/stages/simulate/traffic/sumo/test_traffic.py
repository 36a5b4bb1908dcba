"""Traffic: smooth, repeatable, kept at its number, and the ego stays on the road to the end."""

from __future__ import annotations

import itertools
import os
import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import invert, transform_points
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate.bodies import draw_variants
from advpipe.stages.simulate.road_network.file import sumo_program
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.road_network.roads import resample
from advpipe.stages.simulate.traffic.road_users import RoadUser, footprints
from advpipe.stages.simulate.traffic.sumo.population import SPAWN_DISTANCE_M
from advpipe.stages.simulate.traffic.sumo.traffic import SumoTraffic

TOWN06 = Path(os.environ.get("ADVPIPE_TOWN06", "Town06.xodr"))
BUSY = ["traffic.vehicles=150", "simulation.warmup_s=20"]


def drive(scenario: Scenario, scratch: Path, steps: int) -> list[dict[str, RoadUser]]:
    network = load_network(scenario.map, scratch)
    variants = draw_variants(np.random.default_rng(0))
    states = []
    with SumoTraffic(scenario, network, variants, scratch) as traffic:
        for _ in range(steps):
            traffic.step()
            states.append(traffic.road_users())
    return states


@pytest.fixture(scope="module")
def busy(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, RoadUser]]:
    return drive(load_scenario("smoke", BUSY), tmp_path_factory.mktemp("scratch"), 200)


def front_step_m(before: RoadUser, after: RoadUser) -> np.ndarray:
    """How the front bumper, which SUMO leads, moved from one step to the next, seen from the vehicle."""
    bumper = [before.variant.length_m / 2, 0, 0]
    return transform_points(invert(before.map_SE3_base) @ after.map_SE3_base, bumper) - bumper


def test_vehicles_never_jump_sideways(busy: list[dict[str, RoadUser]]) -> None:
    """A lane is 3.4 m wide: a lane change in one step would show."""
    moved = 0
    for before, after in itertools.pairwise(busy):
        for name in before.keys() & after.keys():
            step_m = front_step_m(before[name], after[name])
            assert abs(step_m[1]) < 1.0
            assert -1.0 < step_m[0] < 3.0  # cyclists cut corners inside a junction
            moved += step_m[0] > 0.3
    assert moved > 1000


def test_some_vehicles_change_lanes(busy: list[dict[str, RoadUser]]) -> None:
    names = set(busy[0]) & set(busy[-1])
    drift = dict.fromkeys(names, 0.0)
    for before, after in itertools.pairwise(busy):
        for name in names:
            drift[name] += abs(front_step_m(before[name], after[name])[1])
    assert max(drift.values()) > 2.0


def test_displacement_agrees_with_speed(busy: list[dict[str, RoadUser]]) -> None:
    errors = [
        np.linalg.norm(after["ego"].position_m - before["ego"].position_m) / 0.1
        - np.linalg.norm(after["ego"].velocity_mps)
        for before, after in itertools.pairwise(busy)
    ]
    assert np.median(np.abs(errors)) < 0.2


def test_the_number_of_vehicles_is_constant(busy: list[dict[str, RoadUser]]) -> None:
    assert all("ego" in state for state in busy)
    assert len(busy[-1]) > 120


def test_the_ego_drives_on(busy: list[dict[str, RoadUser]]) -> None:
    """In 20 s of town traffic it comes some way, and its route goes on beyond."""
    steps_m = [np.linalg.norm(b["ego"].position_m - a["ego"].position_m) for a, b in pairwise(busy)]
    assert sum(steps_m) > 40


def test_new_vehicles_replace_departed_ones_far_from_the_ego(
    tmp_path: Path, grid: Callable[..., Path]
) -> None:
    """A grid with open ends: vehicles leave at its rim."""
    path = grid("--grid.number", "4", "--grid.attach-length", "150", "--no-turnarounds")
    settings = [f"map.sumo_net={path}", "traffic.vehicles=60", "simulation.warmup_s=5"]
    states = drive(load_scenario("smoke", settings), tmp_path, 400)
    newcomers = leavers = 0
    for before, after in pairwise(states):
        leavers += len(before.keys() - after.keys())
        for name in after.keys() - before.keys():
            distance_m = np.linalg.norm(after[name].position_m - after["ego"].position_m)
            assert distance_m > SPAWN_DISTANCE_M
            newcomers += 1
    assert leavers > 5
    assert newcomers > 5
    assert len(states[-1]) > 45


def test_same_seed_same_traffic(busy: list[dict[str, RoadUser]], tmp_path: Path) -> None:
    again = drive(load_scenario("smoke", BUSY), tmp_path, 50)
    for first, second in zip(busy[:50], again, strict=True):
        assert first.keys() == second.keys()
        assert all(np.array_equal(first[name].map_SE3_base, second[name].map_SE3_base) for name in first)


def one_road(folder: Path, length_m: float) -> str:
    """A network of a single one-way road."""
    (folder / "n.nod.xml").write_text(
        f'<nodes><node id="a" x="0" y="0"/><node id="b" x="{length_m}" y="0"/></nodes>'
    )
    (folder / "n.edg.xml").write_text(
        '<edges><edge id="ab" from="a" to="b" numLanes="1" speed="13.9"/></edges>'
    )
    out = folder / "one.net.xml"
    command = [sumo_program("netconvert"), "-n", str(folder / "n.nod.xml"), "-e", str(folder / "n.edg.xml")]
    subprocess.run([*command, "-o", str(out)], check=True, capture_output=True)
    return str(out)


def test_the_ego_stops_at_the_end_of_its_road(tmp_path: Path) -> None:
    """A road of 150 m is driven in 15 s; after 60 s the ego still stands at its end."""
    settings = [f"map.sumo_net={one_road(tmp_path, 150)}", "traffic.vehicles=2", "simulation.warmup_s=1"]
    states = drive(load_scenario("smoke", settings), tmp_path, 600)
    assert all("ego" in state for state in states)
    end = states[-1]["ego"]
    assert end.position_m[0] + end.variant.length_m / 2 == pytest.approx(149, abs=1.5)
    assert np.linalg.norm(end.velocity_mps) < 0.1


def test_a_network_without_room_is_a_one_line_error(tmp_path: Path) -> None:
    """Two egos need more than the five metres that this road has."""
    settings = [f"map.sumo_net={one_road(tmp_path, 5)}", "traffic.vehicles=0", "simulation.warmup_s=0"]
    settings += ["vehicles={ego: {}, other: {}}"]
    with pytest.raises(AdvpipeError, match="no room on the network for ego, other"):
        drive(load_scenario("smoke", settings), tmp_path, 1)


def test_the_ego_may_stop_where_a_road_has_a_pavement(tmp_path: Path, grid: Callable[..., Path]) -> None:
    path = grid("--grid.number", "3", "--sidewalks.guess.from-permissions")
    settings = [f"map.sumo_net={path}", "traffic.vehicles=10", "simulation.warmup_s=1"]
    states = drive(load_scenario("smoke", settings), tmp_path, 5)
    assert all("ego" in state for state in states)


def test_vehicles_on_the_highway_lie_on_its_slopes(tmp_path: Path) -> None:
    """Front, middle and rear of every box are on the lanes' surface, within 5 cm, or 1 % of the length of a
    long one, which bridges a change of slope; and pitch is its slope."""
    scenario = load_scenario("highway", ["simulation.warmup_s=10"])
    edges = load_network(scenario.map, tmp_path).drivable
    lines = [lane.centre_m for edge in edges for lane in edge.lanes]
    lines += [link.centre_m for edge in edges for link in edge.connections]
    dense = np.concatenate([resample(line, 0.5) for line in lines])
    tree = cKDTree(dense[:, :2])
    climbs, speeds = [], []
    for state in drive(scenario, tmp_path, 200)[::20]:
        for user in state.values():
            half_m = user.variant.length_m / 2
            points = transform_points(user.map_SE3_base, [[x, 0, 0] for x in (-half_m, 0, half_m)])
            apart_m, nearest = tree.query(points[:, :2])
            assert apart_m.max() < 2.5
            assert np.abs(points[:, 2] - dense[nearest, 2]).max() < max(0.05, 0.02 * half_m), user.id
            climbs.append(user.map_SE3_base[2, 0])
            speeds.append(float(np.linalg.norm(user.velocity_mps)))
            assert user.velocity_mps[2] == pytest.approx(climbs[-1] * speeds[-1], abs=1e-6)
    assert max(climbs) > 0.035
    assert min(climbs) < -0.035
    assert np.percentile(speeds, 75) > 30


def test_an_ego_whose_route_revisits_its_last_edge_keeps_driving(
    tmp_path: Path, grid: Callable[..., Path]
) -> None:
    """On a small grid a long walk uses each road many times, also its last."""
    path = grid("--grid.number", "2", "--grid.length", "120", "--no-turnarounds")
    settings = [f"map.sumo_net={path}", "traffic.vehicles=3", "simulation.duration_s=60"]
    states = drive(load_scenario("smoke", settings), tmp_path, 600)
    steps_m = [float(np.linalg.norm(b["ego"].position_m - a["ego"].position_m)) for a, b in pairwise(states)]
    assert sum(steps_m[300:]) > 100


@pytest.mark.nightly
@pytest.mark.skipif(not TOWN06.is_file(), reason="set ADVPIPE_TOWN06 to CARLA's Town06.xodr")
def test_traffic_on_town06_keeps_flowing(tmp_path: Path) -> None:
    """100 s at the scenario's density: the ego drives on, among many, and boxes hardly ever overlap."""
    scenario = load_scenario("town06", [f"map.opendrive={TOWN06}"])
    states = drive(scenario, tmp_path, 1000)
    egos = [state["ego"] for state in states]
    standing = np.mean([np.linalg.norm(ego.velocity_mps) < 0.3 for ego in egos])
    assert standing < 0.4
    assert sum(np.linalg.norm(b.position_m - a.position_m) for a, b in pairwise(egos)) > 400
    near = [
        sum(np.linalg.norm(user.position_m - state["ego"].position_m) < 100 for user in state.values()) - 1
        for state in states[::10]
    ]
    assert np.mean(near) > 15
    overlaps = [_overlaps(list(state.values())) for state in states[::20]]
    assert np.mean(overlaps) < 2  # of some 240 boxes


def _overlaps(users: list[RoadUser]) -> int:
    corners = footprints(
        np.stack([user.map_SE3_base for user in users]),
        [(user.variant.length_m, user.variant.width_m) for user in users],
    )
    boxes = shapely.polygons(corners)
    first, second = shapely.STRtree(boxes).query(boxes, predicate="intersects")
    shared = shapely.area(shapely.intersection(boxes[first], boxes[second]))
    return int(np.sum((first < second) & (shared > 0.05)))
