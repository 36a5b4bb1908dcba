"""LiDAR presets and what a LidarSensor refuses."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import dump_scenario, load_scenario
from advpipe.pipeline.sensors.lidar.presets import LIDAR_PRESETS
from advpipe.pipeline.sensors.lidar.section import LidarSensor

# Channels, lowest and highest elevation, columns of a turn at 10 Hz, range: from the makers' datasheets.
DATASHEETS = {
    "vlp-16": (16, -15.0, 15.0, 1808, 100),
    "hdl-32e": (32, -30.667, 10.667, 2170, 100),
    "vlp-32c": (32, -25.0, 15.0, 1808, 200),
    "hdl-64e": (64, -24.333, 2.0, 2083, 120),
    "os1-64": (64, -16.611, 16.611, 1024, 120),
    "os1-128": (128, -22.5, 22.5, 1024, 120),
    "pandar64": (64, -24.897, 14.882, 1800, 200),
    "pandar128": (128, -25.016, 14.436, 1800, 200),
}


@pytest.mark.parametrize("name", LIDAR_PRESETS)
def test_presets_have_the_values_of_their_data_sheets(name: str) -> None:
    channels, lowest, highest, columns, range_m = DATASHEETS[name]
    sensor = LidarSensor(preset=name)
    angles = sensor.vertical_angles_deg
    assert angles is not None
    assert len(angles) == sensor.channels == channels
    assert (angles[0], angles[-1]) == pytest.approx((lowest, highest), abs=1e-3)
    assert (sensor.lower_fov, sensor.upper_fov) == (angles[0], angles[-1])
    assert (sensor.columns, sensor.range) == (columns, range_m)


def test_uneven_elevations_are_densest_near_the_horizon() -> None:
    steps = {
        name: [b - a for a, b in pairwise(LidarSensor(preset=name).vertical_angles_deg or ())]
        for name in LIDAR_PRESETS
    }
    assert steps["vlp-16"] == [2.0] * 15
    assert steps["hdl-64e"][:31] == pytest.approx([0.5] * 31, abs=2e-3)
    assert steps["hdl-64e"][32:] == pytest.approx([1 / 3] * 31, abs=2e-3)
    # A third, a sixth and an eighth of a degree at the horizon, 5 degrees and more at the rims.
    for name, finest in {"vlp-32c": 1 / 3, "pandar64": 1 / 6, "pandar128": 1 / 8}.items():
        assert min(steps[name]) == pytest.approx(finest, abs=0.007)
        assert max(steps[name]) > 3 * min(steps[name])


def test_a_key_overrides_the_preset() -> None:
    sensor = LidarSensor(preset="vlp-16", range=60, noise_stddev=0.0, rotation_frequency=20)
    assert (sensor.range, sensor.noise_stddev, sensor.channels) == (60, 0.0, 16)
    assert sensor.columns == 904  # half as many at twice the rate
    assert LidarSensor(preset="vlp-16", channels=32).vertical_angles_deg is None
    assert LidarSensor(preset="vlp-16", upper_fov=5).vertical_angles_deg is None
    wide = LidarSensor(preset="vlp-16", vertical_angles_deg=[-30, 0, 3])
    assert (wide.channels, wide.lower_fov, wide.upper_fov) == (3, -30, 3)


@pytest.mark.parametrize(
    "lidar",
    [
        "{preset: pandar64}",
        "{preset: vlp-32c, range: 80}",
        "{preset: hdl-64e, channels: 32}",
        "{channels: 16}",
    ],
)
def test_the_resolved_sensor_round_trips(tmp_path: Path, lidar: str) -> None:
    scenario = load_scenario("smoke", [f"sensors.lidars={{top: {lidar}}}"])
    path = tmp_path / "again.yaml"
    path.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(str(path)).sensors == scenario.sensors
    assert "points_per_second" in path.read_text(encoding="utf-8")


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "unknown preset": (
        {"preset": "VLP16"},
        r"preset 'VLP16' is unknown; did you mean 'vlp-16'\? known",
    ),
    "no word": ({"preset": 3}, "valid string"),
    "no channels": ({"channels": 0}, "greater than or equal to 1"),
    "negative channels": ({"channels": -4}, "greater than or equal to 1"),
    "no points": ({"points_per_second": 0}, "greater than or equal to 1"),
    "no turns": ({"rotation_frequency": 0}, "greater than or equal to 0.1"),
    "negative turns": ({"rotation_frequency": -10}, "greater than or equal to 0.1"),
    "too few rays": ({"points_per_second": 100}, "less than one ray per channel and turn"),
    "too many rays": ({"points_per_second": 20_000_000, "rotation_frequency": 1}, "over 2000000; lower"),
    "upside down": ({"upper_fov": -30}, "lower_fov -24.8 is not below upper_fov -30"),
    "miscounted": ({"channels": 3, "vertical_angles_deg": [0, 1]}, "holds 2 angles for 3 channels"),
    "no angles": ({"vertical_angles_deg": []}, "holds 0 angles for 64 channels"),
    "falling": ({"vertical_angles_deg": [0, 1, 1]}, "does not rise"),
    "beyond the zenith": ({"vertical_angles_deg": [0, 91]}, "less than or equal to 90"),
    "no grid": ({"coordinate_grid_m": 0.002}, r"0.002 is not a power of two; the nearest is 0.001953125"),
    "not finite": ({"vertical_angles_deg": [0, float("nan")]}, "less than or equal to 90|finite"),
}


@pytest.mark.parametrize(("keys", "message"), BAD.values(), ids=BAD)
def test_invalid_sensors_are_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        LidarSensor(**keys)


def test_an_unknown_preset_gives_a_one_line_error() -> None:
    with pytest.raises(AdvpipeError, match=r"sensors\.lidars\.lidar: preset 'os2' is unknown") as caught:
        load_scenario("smoke", ["sensors.lidars.lidar.preset=os2"])
    assert "\n" not in str(caught.value)


def test_a_turn_may_take_several_steps() -> None:
    slow = ["simulation.step_s=0.05", "sensors.lidars.lidar.rotation_frequency=5"]
    assert load_scenario("smoke", slow).simulation.step_s == 0.05
    with pytest.raises(
        AdvpipeError, match=r"takes 0\.05 s, which is not a multiple of simulation\.step_s 0\.1"
    ):
        load_scenario("smoke", ["sensors.lidars.lidar.rotation_frequency=20"])


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("sensors.lidars={base_link: {}}", "lidars.base_link has the name of another frame"),
        ("sensors.lidars={imu: {}}", "lidars.imu has the name of another frame"),
        ("sensors.gnss.white_stddev_m=1.0e+9", "less than or equal to 1000"),
        ("sensors.gnss.drift_stddev_m=1.0e+9", "less than or equal to 1000"),
        ("sensors.imu.accelerometer_bias_stddev_mps2=1.0e+26", "less than or equal to 10"),
        ("sensors.imu.gyroscope_bias_stddev_radps=1.0e+26", "less than or equal to 1"),
        ("sensors.wheel_odometry.speed_white_stddev_mps=1.0e+26", "less than or equal to 100"),
        ("bodies={child: {mesh: a.obj}}", "bodies.child has the name of a built-in body"),
        ("bodies={car: {mesh: a.obj}}", "bodies.car has the name of a built-in body"),
        ("simulation.warmup_s=1.0e+9", "less than or equal to 86400"),
        ("map.generator={speed_mps: 1.0e-9}", "greater than or equal to 1"),
    ],
)
def test_names_of_frames_are_unique_and_rays_bounded(setting: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message):
        load_scenario("smoke", [setting])


@pytest.mark.parametrize(
    ("sensors", "world", "name"),
    [
        ({"lidars": {"lidar": {}, "semantic_lidar": {}}}, "carla", "/carla/ego/semantic_lidar"),
        ({"lidars": {"gnss": {}}}, "raycast", "/carla/ego/gnss"),
        ({"lidars": {"odometry": {}}}, "raycast", "/carla/ego/odometry"),
        (
            {"cameras": {"front": {"images": ["depth"]}, "depth_front": {}}},
            "raycast",
            "/carla/ego/depth_front/",
        ),
    ],
)
def test_two_topics_are_not_published_under_one_name(sensors: dict[str, Any], world: str, name: str) -> None:
    settings: dict[str, Any] = {"sensors": sensors, "world": world}
    load_scenario("smoke", settings)
    with pytest.raises(AdvpipeError, match=rf"recording\.names carla_ros_bridge publishes .*{name}") as error:
        load_scenario("smoke", settings | {"recording.names": "carla_ros_bridge"})
    assert str(error.value).endswith("rename one of the sensors")
    assert "\n" not in str(error.value)


def test_names_that_only_look_alike_are_taken() -> None:
    """The ray-caster has no semantic LiDARs, and a camera without depth images publishes none."""
    lidars: dict[str, Any] = {"lidar": {}, "semantic_lidar": {}}
    sensors = {"lidars": lidars, "cameras": {"front": {}, "depth_front": {}}}
    scenario = load_scenario("smoke", {"sensors": sensors, "recording.names": "carla_ros_bridge"})
    assert len(list(scenario.sensors.mounted())) == 4
