"""Lights of SUMO's vehicles and junctions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.road_network.network import load_network
from advpipe.stages.simulate.traffic.protocol import SignalisedTraffic
from advpipe.stages.simulate.traffic.registry import open_traffic
from advpipe.stages.simulate.traffic.sumo.signals import lights_of

ALWAYS = ExteriorLights.DAYTIME_RUNNING


@pytest.mark.parametrize(
    ("signals", "lights"),
    [
        (0, ALWAYS),
        (1, ALWAYS | ExteriorLights.RIGHT_TURN_SIGNAL),
        (2 | 8, ALWAYS | ExteriorLights.LEFT_TURN_SIGNAL),  # CAMs have no brake lights
        (4, ALWAYS | ExteriorLights.LEFT_TURN_SIGNAL | ExteriorLights.RIGHT_TURN_SIGNAL),
        (16 | 128, ALWAYS | ExteriorLights.LOW_BEAM | ExteriorLights.REVERSE),
    ],
)
def test_lights_of_vehicles(signals: int, lights: ExteriorLights) -> None:
    assert lights_of(signals) == lights


def test_signals_go_by_the_names_that_netconvert_gives_them(
    road: Callable[..., Path], variants: dict[str, Variant], tmp_path: Path
) -> None:
    keys = {"map": {"sumo_net": str(road(300.0, light=True))}, "vehicles": {}, "traffic.vehicles": 1}
    scenario = load_scenario("smoke", keys)
    network = load_network(scenario.map, tmp_path, 1)
    with open_traffic(scenario, network, variants, tmp_path) as traffic:
        assert isinstance(traffic, SignalisedTraffic)
        seen = set()
        for _ in range(300):
            traffic.step()
            states = traffic.signals()
            seen |= set(states.values())
    assert all(name.startswith("b_") for name in states)
    assert len(states) == 2
    assert {"r", "y"} <= {letter.lower() for letter in seen}
