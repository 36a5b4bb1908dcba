"""Radars of the scenario file: presets, and one line for each mistake."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.sensors.radar.presets import RADAR_PRESETS
from advpipe.pipeline.sensors.radar.section import RadarSensor


@pytest.mark.parametrize("name", RADAR_PRESETS)
def test_presets_set_keys_that_others_override(name: str) -> None:
    assert RadarSensor(preset=name).range == RADAR_PRESETS[name]["range"]
    assert RadarSensor(preset=name, range=55.0).range == 55.0


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ("horizontal_fov: 0", "horizontal_fov: Input should be greater than or equal to 0.1"),
        ("horizontal_fov: 360", "horizontal_fov: Input should be less than 360"),
        ("horizontal_fov: -20", "horizontal_fov: Input should be greater than or equal to 0.1"),
        ("vertical_fov: 181", "vertical_fov: Input should be less than or equal to 180"),
        ("z_m: -0.2", "z_m: Input should be greater than or equal to 0.01"),
        ("preset: corners", "preset 'corners' is unknown; "),
        ("range_resolution_m: 0", "range_resolution_m: Input should be greater than or equal to 0.01"),
        ("swerling: 2", "swerling: Input should be 0, 1 or 3"),
        ("azimuth_resolution_deg: 60", "azimuth_resolution_deg 60 is beyond all that it divides, 30"),
        ("{range: 500, range_resolution_m: 0.01, max_velocity_mps: 500, velocity_resolution_mps: 0.001}",
         "the range-Doppler map has 5e+10 cells, over 1e+10"),
        ("sensor_tick: 0.25", "sensors.radars.front.sensor_tick 0.25 s is not a multiple of"),
        ("points_per_second: 20000000", "a scan of sensors.radars.front has 2,000,000 rays, over 1,000,000"),
        ("vehicle: bus", "sensors.radars.front.vehicle 'bus' is not one of the vehicles (ego)"),
        ("fov: 3", "unknown key"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line(keys: str, problem: str, tmp_path: Path) -> None:
    written = keys if keys.startswith("{") else f"{{{keys}}}"
    (tmp_path / "s.yaml").write_text(
        f"name: s\nmap: {{generator: {{kind: grid}}}}\nsensors: {{radars: {{front: {written}}}}}\n"
    )
    with pytest.raises(AdvpipeError) as error:
        load_scenario(str(tmp_path / "s.yaml"))
    assert problem in str(error.value).replace(" (line 3)", "")
    assert "\n" not in str(error.value)
