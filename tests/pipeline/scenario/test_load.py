"""Scenario files: defaults, overrides, and errors that name place, line and nearest key."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.scenario import dump_scenario, load_scenario, shipped_scenarios

GOOD = "name: here\nmap:\n  sumo_net: boulevard.net.xml\n"


def written(folder: Path, text: str) -> str:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", ["boulevard", "town06", "smoke"])
def test_shipped_scenarios_load(name: str) -> None:
    assert name in shipped_scenarios()
    assert load_scenario(name).name == name


def test_the_resolved_scenario_loads_again_as_the_same(tmp_path: Path) -> None:
    scenario = load_scenario("boulevard", ["simulation.seed=9", "traffic.mix={sedan: 1, bus: 2}"])
    again = load_scenario(written(tmp_path, dump_scenario(scenario)))
    assert again == scenario
    assert again.simulation.seed == 9
    assert again.traffic.mix == {"sedan": 1, "bus": 2}


def test_the_resolved_scenario_names_no_folder(tmp_path: Path) -> None:
    scenario = load_scenario("town06", [f"map.opendrive={tmp_path}/Town06.xodr"])
    assert str(tmp_path) not in dump_scenario(scenario)
    assert yaml.safe_load(dump_scenario(scenario))["map"]["opendrive"] == "Town06.xodr"


BAD = {
    "simulation:\n  sed: 3\n": r"simulation\.sed \(line 5\): unknown key; did you mean 'seed'\?",
    "simulaton: {}\n": r"simulaton \(line 4\): unknown key; did you mean 'simulation'\?",
    "simulation:\n  duration_s: -3\n": r"simulation\.duration_s \(line 5\): .*greater than 0, not -3",
    "simulation:\n  duration_s: 0.01\n": r"shorter than one step",
    "simulation:\n  duration_s: .nan\n": r"simulation\.duration_s \(line 5\): .*finite",
    "sensors:\n  lidar:\n    channels: 0\n": r"sensors\.lidar\.channels \(line 6\)",
    "sensors:\n  lidar:\n    rotation_frequency: 7\n": r"make them equal",
    "sensors:\n  lidar:\n    vehicle: bob\n": r"lidar\.vehicle 'bob' is none of the vehicles \(ego\)",
    "vehicles: {}\n": r"vehicles is empty",
    "traffic:\n  mix: {tank: 1}\n": r"traffic\.mix\.tank \(line 5\)",
    "traffic:\n  mix: {sedan: 0}\n": r"at least one share above zero",
}


@pytest.mark.parametrize(("text", "message"), BAD.items())
def test_bad_keys_and_values_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_scenario(written(tmp_path, GOOD + text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("simulation.duration_s=-1", "greater than 0"),
        ("simulation.durations=1", "did you mean 'duration_s'"),
        ("simulation", "write section.key=value"),
        ("name.first=x", "name is a value"),
        ("simulation.seed={", "not YAML"),
    ],
)
def test_bad_overrides(override: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message):
        load_scenario("smoke", [override])


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "holds no scenario"), (b"\xff\xfe\x00", "text"), (b"a: [", "line 1"), (b"- 1\n", "no scenario")],
)
def test_files_that_are_no_scenario(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(AdvpipeError, match=message):
        load_scenario(str(path))


def test_an_unknown_name_lists_the_shipped_ones() -> None:
    with pytest.raises(AdvpipeError, match=r"boulevard.*did you mean 'boulevard'"):
        load_scenario("boulevrd")
