"""A drive with two radars, a second long, and attacks on it."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

SCENARIO = """
name: radar
simulation: {duration_s: 1.2, warmup_s: 12, seed: 3}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 80, pedestrians: 10}
sensors:
  lidars: {lidar: {channels: 4, points_per_second: 7200}}
  radars:
    front: {preset: long-range, false_alarm_probability: 1e-5}
    side: {preset: corner, yaw_deg: 50, sensor_tick: 0.2}
v2x: {enabled: false}
"""
FROM_S, TO_S = 0.4, 1.0


@pytest.fixture(scope="session")
def radar_drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set: clean/, and an attack of each kind on it, all from 0.4 to 1 s."""
    folder = tmp_path_factory.mktemp("radar")
    (folder / "radar.yaml").write_text(SCENARIO, encoding="utf-8")
    simulate(load_scenario(str(folder / "radar.yaml")), folder / "drive")
    clean, schedule = folder / "drive" / "clean", Schedule(from_s=FROM_S, to_s=TO_S)
    for name, parameters in {
        "spoof": {"range_m": 30.0, "closing_mps": 10.0, "radar": "front"},
        "jam": {},
        "delete": {},
    }.items():
        spec = AttackSpec(type=f"radar-{name}", parameters=parameters, schedule=schedule)
        attack(clean, folder / "drive" / name, AttackRequest((spec,)))
    return folder / "drive"
