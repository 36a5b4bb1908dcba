"""Random walks follow lanes and avoid dead ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.road_network.network import Connection, Edge, Lane, RoadNetwork, load_network
from advpipe.stages.simulate.traffic.sumo.routes import Routes


def edge(name: str, length_m: float, links: list[tuple[int, str, int]], lanes: int = 2) -> Edge:
    line = np.array([[0.0, 0, 0], [length_m, 0, 0]])
    return Edge(
        name,
        tuple(Lane(line, 3.5, True) for _ in range(lanes)),
        length_m,
        10.0,
        True,
        tuple(sorted({to for _, to, _ in links})),
        tuple(Connection(a, to, b, np.empty((0, 3)), None) for a, to, b in links),
    )


def network(*edges: Edge) -> RoadNetwork:
    return RoadNetwork(Path("none"), np.zeros(3), {each.id: each for each in edges}, (), "")


@pytest.mark.parametrize(("length_m", "ways"), [(50.0, {"left"}), (500.0, {"left", "right"})])
def test_a_short_road_leaves_no_time_to_change_lanes(length_m: float, ways: set[str]) -> None:
    """Lane 1 leads left, lane 0 right; at 10 m/s a change takes 90 m."""
    start = edge("start", length_m, [(0, "right", 0), (1, "left", 0)])
    ring = [edge(name, 100, [(0, name, 0)], lanes=1) for name in ("left", "right")]
    routes = Routes(network(start, *ring), np.random.default_rng(0))
    seen = {routes.random_walk(start, 1, length_m + 1)[1] for _ in range(40)}
    assert seen == ways


def test_a_stranded_vehicle_continues_along_its_lane() -> None:
    """The right-hand lane leads to a dead end, and there is no other way at its end."""
    start = edge("start", 500, [(0, "dead", 0), (1, "ring", 0)])
    dead, ring = edge("dead", 100, [], lanes=1), edge("ring", 100, [(0, "ring", 0)], lanes=1)
    routes = Routes(network(start, dead, ring), np.random.default_rng(0))
    assert routes.random_walk(start, 0, 5000, keep_lane=True) == ["start", "dead"]
    assert routes.random_walk(start, 0, 900)[1] == "ring"


@pytest.mark.parametrize("name", ["boulevard", "highway"])
def test_random_walks_are_drivable_and_long_enough(tmp_path: Path, name: str) -> None:
    found = load_network(load_scenario(name).map, tmp_path)
    routes = Routes(found, np.random.default_rng(1))
    for _ in range(50):
        start = routes.random_start()
        walk = routes.random_walk(start, routes.random_lane(start), 8000.0)
        assert routes.checked(walk, "here") == walk
        assert sum(found.edges[each].length_m for each in walk) >= 8000
