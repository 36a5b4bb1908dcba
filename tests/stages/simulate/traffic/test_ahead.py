"""Traffic in another process gives the same drive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.traffic import ahead
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.road_users import RoadUser

ALONE = ("vehicles={}", "simulation.duration_s=1", "v2x.penetration=1")


def test_it_is_for_long_drives_that_nothing_acts_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ahead, "usable_cores", lambda: 2)
    fleet = ["vehicles={}", "traffic.vehicles=300", "simulation.duration_s=300"]
    assert ahead.pays_ahead(load_scenario("boulevard", fleet))
    assert not ahead.pays_ahead(load_scenario("boulevard", fleet[1:]))  # sensors: the world takes the time
    assert not ahead.pays_ahead(load_scenario("boulevard", [*fleet, "simulation.duration_s=3"]))
    assert not ahead.pays_ahead(load_scenario("boulevard", [*fleet, "traffic.transport=traci"]))
    monkeypatch.setattr(ahead, "usable_cores", lambda: 1)
    assert not ahead.pays_ahead(load_scenario("boulevard", fleet))


def test_the_drive_is_the_same_to_the_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_scenario("smoke", ALONE)
    bags = {}
    for is_ahead in (False, True):
        monkeypatch.setattr("advpipe.stages.simulate.traffic.registry.pays_ahead", lambda _, on=is_ahead: on)
        summary = simulate(scenario, tmp_path / str(is_ahead))
        assert summary.v2x is not None
        assert summary.v2x.cams > 10
        bags[is_ahead] = [path.read_bytes() for path in sorted(summary.bag.glob("*.mcap"))]
    assert bags[True] == bags[False]


def test_a_mistake_in_the_scenario_is_found_before_the_process_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("advpipe.stages.simulate.traffic.registry.pays_ahead", lambda _: True)
    with pytest.raises(UsageError, match=r"missing\.rou\.xml"):
        simulate(load_scenario("smoke", [*ALONE, "traffic.routes=missing.rou.xml"]), tmp_path / "drive")


def test_external_vehicles_are_refused_since_nothing_reacts_to_them(
    tmp_path: Path, variants: dict[str, Variant], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("advpipe.stages.simulate.traffic.registry.pays_ahead", lambda _: True)
    scenario = load_scenario("smoke", ALONE)
    traffic = open_traffic(scenario, load_network(scenario.map, tmp_path), variants, tmp_path)
    traffic.push([])
    with pytest.raises(AdvpipeError, match="takes no external vehicles"):
        traffic.push([RoadUser("wall", variants["sedan.0"], np.eye(4), np.zeros(3))])
