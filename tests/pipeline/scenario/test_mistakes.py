"""All mistakes of a scenario come at once, each with its key, its line and what may be meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario

HEAD = "name: x\nmap: {generator: {}}\n"


def refusal(tmp_path: Path, text: str, *settings: str) -> str:
    path = tmp_path / "a.yaml"
    path.write_text(f"{HEAD}{text}")
    with pytest.raises(AdvpipeError) as caught:
        load_scenario(str(path), settings)
    found = str(caught.value)
    assert "\n" not in found
    assert found.startswith((f"{path}: ", "settings "))
    return found.removeprefix(f"{path}: ")


def test_several_are_numbered(tmp_path: Path) -> None:
    text = "simulation: {sed: 3, duration_s: -1}\ntraffic:\n  vehicles: many\n"
    line = refusal(tmp_path, text, "v2x.penetratoin=1")
    assert line.startswith("4 mistakes: (1) ")
    assert "simulation.sed (line 3): unknown key; did you mean 'seed'? known: seed, " in line
    assert "simulation.duration_s (line 3): Input should be greater than" in line
    assert "traffic.vehicles (line 5): Input should be a valid integer, not 'many'" in line
    assert "settings v2x.penetratoin: unknown key; did you mean 'penetration'?" in line
    assert [f"({number}) " in line for number in range(1, 6)] == [True] * 4 + [False]


def test_a_list_with_a_wrong_item_is_not_called_too_short(tmp_path: Path) -> None:
    line = refusal(tmp_path, "sensors: {cameras: {front: {images: [foo]}}}\n")
    assert line.startswith("sensors.cameras.front.images[0] (line 3): Input should be 'rgb', 'depth', ")
    assert "at least 1" not in line
    assert "has 0 items; at least 1 " in refusal(tmp_path, "sensors: {cameras: {front: {images: []}}}\n")
    six = refusal(tmp_path, "sensors: {cameras: {front: {distortion: [0, 0, 0, 0, 0, 0]}}}\n")
    assert "has 6 items; at most 5 are allowed" in six


def test_parameters_of_an_attack_have_their_place(tmp_path: Path) -> None:
    line = refusal(tmp_path, "attacks: {a: {type: detach, ratio: 1%}}\n")
    known = "unknown key; known: type, recipe, parameters, "
    assert line.startswith(f"attacks.a.ratio (line 3): detach: {known}")
    assert line.endswith("; an attack's own go into `parameters`")


def test_those_between_sections_come_at_once(tmp_path: Path) -> None:
    text = (
        "traffic: {mix: {tank: 1}}\nattacks:\n"
        "  a:\n  - {type: x, victim: he}\n  - {type: y, schedule: {from_s: 9000}}\n"
    )
    line = refusal(tmp_path, text)
    assert line.startswith("3 mistakes: (1) traffic.mix.tank is not a known body; ")
    assert "; (2) attacks.a[0] (line 6): x names the victim 'he', which is not one of the vehicles" in line
    assert "; (3) attacks.a[1] (line 7): y begins at 9000 s, but the recording ends at " in line


def test_those_of_keys_do_not_hide_those_between_sections(tmp_path: Path) -> None:
    text = "simulation: {seed: many}\ntraffic: {mix: {tank: 1}}\nsensors: {lidars: {top: {vehicle: bus}}}\n"
    line = refusal(tmp_path, text)
    assert line.startswith("3 mistakes: (1) simulation.seed (line 3): ")
    assert "(2) traffic.mix.tank is not a known body; " in line
    assert "(3) sensors.lidars.top.vehicle 'bus' is not one of the vehicles (ego)" in line


def test_what_a_wrong_key_may_explain_is_no_mistake(tmp_path: Path) -> None:
    text = "simulation: {duration_s: long}\nattacks: {a: {type: detach, schedule: {from_s: 900}}}\n"
    assert "mistakes" not in refusal(tmp_path, text)
    assert "mistakes" not in refusal(
        tmp_path, "vehicles: {bus: {body: 3}}\nsensors: {lidars: {top: {vehicle: bus}}}\n"
    )


def test_a_missing_file_is_listed_beside_others(tmp_path: Path) -> None:
    missing = tmp_path / "there_is.none"
    line = refusal(tmp_path, "simulation: {sed: 3}\n", "map.generator=null", f"map.sumo_net={missing}")
    assert line.startswith("2 mistakes: (1) simulation.sed (line 3): ")
    assert line.endswith(f"(2) settings map.sumo_net: {str(missing)!r} does not exist")


def test_one_is_not_numbered(tmp_path: Path) -> None:
    line = refusal(tmp_path, "simulation: {sed: 3}\n")
    assert line.startswith("simulation.sed (line 3): unknown key; did you mean 'seed'?")
    assert refusal(tmp_path, "", "simulation.sed=3").startswith("settings simulation.sed: unknown key; did")


def test_a_value_that_may_have_several_forms_is_one_mistake(tmp_path: Path) -> None:
    assert "mistakes" not in refusal(tmp_path, "attacks: {a: {type: 3}}\n")


def test_very_many_are_counted(tmp_path: Path) -> None:
    keys = ", ".join(f"odd_{number}: 1" for number in range(1000))
    line = refusal(tmp_path, f"traffic: {{{keys}}}\n")
    assert line.startswith("1000 mistakes: (1) ")
    assert "(20) " in line
    assert line.endswith("; and 980 more")
    assert len(line) < 20_000
