"""People on foot: on the network's pavements where it has any, beside the kerb elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely

from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.road_network.roads import lay_out_roads
from advpipe.stages.simulate.traffic.walkers import STRAY_M, draw_walkers


def test_pedestrians_walk_on_pavements(
    tmp_path: Path, grid: Callable[..., Path], variants: dict[str, Variant]
) -> None:
    path = grid("--grid.number", "3", "--grid.length", "100", "--sidewalks.guess.from-permissions")
    scenario = load_scenario("smoke", [f"map.sumo_net={path}", "traffic.pedestrians=50"])
    network = load_network(scenario.map, tmp_path)
    assert len(network.pavements_m) == 24
    walkers = draw_walkers(
        scenario, lay_out_roads(network), variants, [network.pavements_m[0]], network.pavements_m
    )
    assert len(walkers) == 50
    lines = shapely.MultiLineString([line[:, :2] for line in network.pavements_m])
    for walker in walkers:
        for time_s in (0.0, 30.0, 77.0):
            user = walker.at(time_s)
            assert lines.distance(shapely.Point(user.position_m[:2])) < STRAY_M + 0.05
            assert user.position_m[2] == 0


def test_pedestrian_velocities_match_their_displacements(
    tmp_path: Path, variants: dict[str, Variant]
) -> None:
    scenario = load_scenario("smoke")
    network = load_network(scenario.map, tmp_path)
    walkers = draw_walkers(
        scenario, lay_out_roads(network), variants, [network.drivable[0].lanes[0].centre_m]
    )
    assert len(walkers) == scenario.traffic.pedestrians
    moved = [
        np.linalg.norm(
            (walker.at(5.01).position_m - walker.at(5.0).position_m) / 0.01 - walker.at(5.0).velocity_mps
        )
        for walker in walkers
    ]
    assert np.median(moved) == pytest.approx(0, abs=1e-6)
