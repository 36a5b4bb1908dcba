"""A drive with two cameras, a second long, and attacks on it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.simulate.run import simulate

SCENARIO = """
name: camera
simulation: {duration_s: 1.2, warmup_s: 13, seed: 3, start: 2026-06-21T10:00:00Z}
map: {sumo_net: boulevard.net.xml}
traffic: {vehicles: 120, pedestrians: 10}
sensors:
  lidars: {lidar: {channels: 4, points_per_second: 7200}}
  cameras:
    front:
      preset: front
      image_size_x: 320
      image_size_y: 180
      images: [rgb, depth, instance_segmentation]
    rear:
      preset: fisheye
      yaw_deg: 180
      x_m: -2.2
      image_size_x: 160
      image_size_y: 120
      sensor_tick: 0.2
      images: [rgb, depth, instance_segmentation]
"""
FROM_S, TO_S = 0.4, 0.9


@pytest.fixture(scope="session")
def camera_drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set: clean/, and an attack of each kind on its front camera, all from 0.4 to 0.9 s."""
    folder = tmp_path_factory.mktemp("camera")
    (folder / "camera.yaml").write_text(SCENARIO, encoding="utf-8")
    simulate(load_scenario(str(folder / "camera.yaml")), folder / "drive")
    clean, schedule = folder / "drive" / "clean", Schedule(from_s=FROM_S, to_s=TO_S)
    for name, parameters in {
        "drop": {},
        "freeze": {},
        "delay": {"delay_s": 0.25},
        "blind": {},
        "patch": {"pattern": "random"},
    }.items():
        own = {"camera": "front", **parameters}
        spec = AttackSpec(type=f"camera-{name}", parameters=own, schedule=schedule)
        attack(clean, folder / "drive" / name, AttackRequest((spec,)))
    return folder / "drive"
