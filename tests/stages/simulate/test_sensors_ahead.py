"""Sensors in a process of their own: the same bag, and their errors."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.scenario import Scenario, load_scenario
from advpipe.stages.simulate import run, sensors_ahead
from advpipe.stages.simulate.run import simulate
from advpipe.stages.simulate.sensors_ahead import WORTH_A_PROCESS, pays_ahead, shared_out

TWO = [
    "simulation.duration_s=0.8",
    "vehicles={ego: {}, other: {}}",
    "sensors.lidars={lidar: {channels: 16, points_per_second: 20000}, "
    "roof: {vehicle: other, channels: 8, points_per_second: 10000, rotation_frequency: 5}}",
    "sensors.radars={front: {}}",
    "sensors.cameras={front: {vehicle: other, image_size_x: 64, image_size_y: 36, sensor_tick: 0.2}}",
]


def scenario(*settings: str) -> Scenario:
    return load_scenario("smoke", [*TWO, *settings])


def test_the_bag_is_the_same_byte_for_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone = simulate(scenario(), tmp_path / "alone")
    started: list[bool] = []
    monkeypatch.setattr(run, "pays_ahead", lambda _: not started.append(True))
    ahead = simulate(scenario(), tmp_path / "ahead")
    assert started
    assert (ahead.clouds, ahead.points, ahead.road_users) == (alone.clouds, alone.points, alone.road_users)
    assert alone.clouds == 8 + 4
    bags = [sha256_of(next(summary.bag.glob("*.mcap"))) for summary in (alone, ahead)]
    assert bags[0] == bags[1]


def test_an_error_of_the_sensors_ends_the_drive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "pays_ahead", lambda _: True)
    begin = sensors_ahead.SensorsAhead.begin

    def killed(self: sensors_ahead.SensorsAhead, *args: object) -> None:
        begin(self, *args)  # type: ignore[arg-type]
        self._processes[-1]._process.kill()

    monkeypatch.setattr(sensors_ahead.SensorsAhead, "begin", killed)
    with pytest.raises(AdvpipeError, match="a worker process died"):
        simulate(scenario(), tmp_path / "drive")
    assert not (tmp_path / "drive").exists()


def test_cameras_which_take_long_have_a_process_apart() -> None:
    assert shared_out(scenario()) == [("lidars", "radars"), ("cameras",)]
    assert shared_out(scenario("sensors.cameras={}")) == [("lidars", "radars")]
    assert shared_out(scenario("sensors.lidars={}", "sensors.radars={}")) == [("cameras",)]


@pytest.mark.parametrize(
    ("settings", "cores", "is_worth_it"),
    [
        ([f"simulation.duration_s={WORTH_A_PROCESS / 20}"], 2, True),
        ([f"simulation.duration_s={WORTH_A_PROCESS / 20}"], 1, False),
        (["simulation.duration_s=0.8"], 2, False),
        (["simulation.duration_s=60", "vehicles={}"], 2, False),
        (["simulation.duration_s=60", "v2x.cpm={}"], 2, False),  # what it perceives is sent in the same step
    ],
)
def test_a_process_is_started_only_where_it_is_worth_it(
    settings: list[str], cores: int, is_worth_it: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensors_ahead, "usable_cores", lambda: cores)
    assert pays_ahead(scenario(*settings)) is is_worth_it
