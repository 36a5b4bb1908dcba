"""A world of a user's own in a drive: the sensors see what it shows them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import xyz
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.lidar.imperfections import IDEAL
from advpipe.stages.simulate.run import simulate

FEW = ("simulation.duration_s=0.3", "sensors.lidars.lidar.noise_stddev=0", "v2x.enabled=false")
EXACT = f"sensors.lidars.lidar.imperfections={json.dumps(IDEAL.model_dump())}"


@pytest.fixture(autouse=True)
def in_its_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def test_a_lidar_works_in_a_users_flat_world(tmp_path: Path) -> None:
    scenario = load_scenario("smoke", ["world=flat_world:Flat", *FEW, EXACT])
    summary = simulate(scenario, tmp_path / "drive")
    frames = list(read_frames(tmp_path / "drive" / "clean"))
    assert len(frames) == 3
    assert summary.points == sum(len(frame.cloud) for frame in frames) > 5000
    assert summary.road_users > 5  # they are there, and cast nothing back
    for frame in frames:
        assert np.abs(xyz(frame.cloud)[:, 2] + scenario.sensors.lidars["lidar"].z_m).max() < 1e-3


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gta", r"world 'gta' is unknown; known: raycast, carla \(or your own module:Class\)"),
        ("flat_world:Nothing", "world flat_world:Nothing is not a world: it lacks "),
        ("flat_world:Blind", "sensors.lidars need rays, which the world flat_world:Blind does not offer"),
    ],
)
def test_an_invalid_implementation_is_a_one_line_error(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        simulate(load_scenario("smoke", [f"world={name}", *FEW]), tmp_path / "drive")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "drive").exists()
