"""Scenario files: defaults, overrides, and errors that name place, line and nearest key."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import dump_scenario, load_scenario, shipped_scenarios

GOOD = "name: here\nmap:\n  sumo_net: boulevard.net.xml\n"


def written(folder: Path, text: str) -> str:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", ["district", "boulevard", "town06", "smoke", "highway"])
def test_shipped_scenarios_load(name: str) -> None:
    assert name in shipped_scenarios()
    assert load_scenario(name).name == name


def test_the_resolved_scenario_round_trips(tmp_path: Path) -> None:
    scenario = load_scenario("boulevard", ["simulation.seed=9", "traffic.mix={sedan: 1, bus: 2}"])
    again = load_scenario(written(tmp_path, dump_scenario(scenario)))
    assert again == scenario
    assert again.simulation.seed == 9
    assert again.traffic.mix == {"sedan": 1, "bus": 2}


def test_the_resolved_scenario_holds_no_folders(tmp_path: Path) -> None:
    scenario = load_scenario("town06", [f"map.opendrive={tmp_path}/Town06.xodr"])
    assert str(tmp_path) not in dump_scenario(scenario)
    assert yaml.safe_load(dump_scenario(scenario))["map"]["opendrive"] == "Town06.xodr"


BAD = {
    "simulation:\n  sed: 3\n": r"simulation\.sed \(line 5\): unknown key; did you mean 'seed'\?",
    "simulaton: {}\n": r"simulaton \(line 4\): unknown key; did you mean 'simulation'\?",
    "simulation:\n  duration_s: -3\n": r"simulation\.duration_s \(line 5\): .*equal to 0\.001, not -3",
    "simulation:\n  duration_s: 0.01\n": r"shorter than one step",
    "simulation:\n  duration_s: .nan\n": r"simulation\.duration_s \(line 5\): .*finite",
    "sensors:\n  lidars:\n    lidar:\n      channels: 0\n": r"sensors\.lidars\.lidar\.channels \(line 7\)",
    "sensors:\n  lidars:\n    lidar:\n      rotation_frequency: 7\n": r"0\.142857 s, which is not a multiple",
    "sensors:\n  lidars:\n    lidar:\n      vehicle: bob\n": r"'bob' is not one of the vehicles",
    "vehicles: {}\nv2x: {enabled: false}\n": r"vehicles is empty and V2X is off",
    "traffic:\n  mix: {tank: 1}\n": r"traffic\.mix\.tank is not a known body; known: city_car",
    "traffic:\n  mix: {sedan: 0}\n": r"at least one share above zero",
    "traffic:\n  mix: {sedan: 1.0e+300}\n": r"mix\.sedan \(line 5\): .*less than or equal to 1000000",
    "simulation:\n  start: 1999-12-31T23:00:00Z\n": r"start is in 1999; .* between 2000 and 2037",
    "simulation:\n  start: 2038-01-01T00:00:00Z\n": r"start is in 2038; .* between 2000 and 2037",
    "simulation:\n  step_s: 0.0625\nsensors: {lidars: {lidar: {rotation_frequency: 16}}}\n": r"not a whole",
    "simulation:\n  step_s: 0.0015\n": r"whole number of milliseconds",
    "sensors:\n  lidars:\n    lidar:\n      x_m: .nan\n": r"x_m \(line 7\): .*finite",
    "sensors:\n  lidars:\n    lidar:\n      x_m: -.inf\n": r"x_m \(line 7\): .*finite",
    "sensors:\n  lidars:\n    lidar:\n      points_per_second: 20000001\n": r"less than or equal to 20000000",
    "sensors:\n  lidars:\n    lidar:\n      rotation_frequency: 1.0e-320\n": r"greater than or equal to 0.1,",
    "simulation:\n  seed: 1\n  seed: 2\n": r"mine\.yaml line 6: 'seed' is given twice",
    "name: again\n": r"line 4: 'name' is given twice",
    "simulation:\n  start: 2026-02-30\n": r"line 5: '2026-02-30' is not a valid timestamp \(day is out",
    f"simulation:\n  seed: {'9' * 5000}\n": r"mine\.yaml line 5: a number has 5000 characters",
    f"simulation:\n  seed: 0x{'f' * 5000}\n": r"mine\.yaml line 5: a number has 5002 characters",
    f"traffic: {'[' * 3000}{']' * 3000}\n": r"nested more than 50 levels deep",
    f"description: {{a: {'x' * 5000}}}\n": r"description \(line 4\): .{,300}$",
    f"vehicles: [{'x' * 5000}]\n": r"vehicles \(line 4\): .{,300}$",
    "traffic: &t {mix: *t}\n": r"mine\.yaml line 4: an alias refers to a value that contains the alias",
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=range(len(BAD)))
def test_errors_name_invalid_keys_and_values(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_scenario(written(tmp_path, GOOD + text))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("simulation.duration_s=-1", r"equal to 0\.001, not -1"),
        ("simulation.durations=1", "did you mean 'duration_s'"),
        ("simulation", "write section.key=value"),
        ("name.first=x", "name is a value"),
        ("simulation.seed={", "not YAML"),
        ("simulation.start=2026-02-30", "day is out of range for month"),
        (f"simulation.seed={'9' * 5000}", r"^settings .{,200}a number has 5000 characters"),
        (f"traffic={'[' * 3000}", "nested more than 50 levels deep"),
        ("simulation.duration_s=-1", r"^settings simulation\.duration_s: Input .*, not -1$"),
        ("simulation.duration_s=0.01", r"^settings simulation: duration_s 0\.01 is shorter"),
        ("simulation={duration_s: -1}", r"^settings simulation\.duration_s: "),
        ("map=&m {origin: *m}", r"^settings 'map=.*contains the alias itself"),
    ],
    ids=lambda text: text[:40],
)
def test_invalid_overrides_are_refused(override: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message):
        load_scenario("smoke", [override])


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "holds no scenario"), (b"\xff\xfe\x00", "text"), (b"a: [", "line 1"), (b"- 1\n", "no scenario")],
)
def test_files_that_are_no_scenario_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(content)
    with pytest.raises(AdvpipeError, match=message):
        load_scenario(str(path))


def test_an_unknown_name_lists_the_shipped_ones() -> None:
    with pytest.raises(AdvpipeError, match=r"boulevard.*did you mean 'boulevard'"):
        load_scenario("boulevrd")


def test_a_cyclic_alias_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match=r"mine\.yaml line 2: an alias refers to a value that contains"):
        load_scenario(written(tmp_path, "name: here\nmap: &m {origin: *m}\n"))


def test_an_unrelated_override_does_not_hide_the_error_of_the_file(tmp_path: Path) -> None:
    bad = written(tmp_path, GOOD + "simulation: {seed: -1}\n")
    with pytest.raises(AdvpipeError, match=r"mine\.yaml: simulation\.seed \(line 4\)"):
        load_scenario(bad, ["simulation.duration_s=1"])


def test_a_name_of_any_length_is_searched_for() -> None:
    with pytest.raises(AdvpipeError, match=r"^no scenario 'x.{,300}$"):
        load_scenario("x" * 5000)


def test_the_missing_map_of_a_shipped_scenario_has_no_folder(tmp_path: Path) -> None:
    assert load_scenario("town06").map.opendrive == "Town06.xodr"
    mine = written(tmp_path, "name: here\nmap: {opendrive: Town06.xodr}\n")
    assert load_scenario(mine).map.opendrive == str(tmp_path / "Town06.xodr")
