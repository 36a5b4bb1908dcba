"""Attacks in scenario files: schedules computed by hand, and one-line errors."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import dump_scenario, load_scenario
from advpipe.pipeline.scenario.attacks import Schedule, attack_spec
from advpipe.pipeline.scenario.schema import scenario_schema

RNG = np.random.default_rng(0)
GOOD = "name: here\nmap:\n  sumo_net: boulevard.net.xml\n"


def times_on(schedule: Schedule, step_s: float = 0.1, count: int = 12) -> list[int]:
    return [k for k in range(count) if schedule.active(k * step_s, RNG)]


@pytest.mark.parametrize(
    ("schedule", "expected"),
    [
        (Schedule(), list(range(12))),
        (Schedule(from_s=0.3), list(range(3, 12))),
        (Schedule(from_s=0.3, to_s=0.6), [3, 4, 5]),  # 0.1 * 3 is a hair above 0.3, 0.1 * 6 above 0.6
        (Schedule(kind="periodic", period_s=0.4, on_s=0.2), [0, 1, 4, 5, 8, 9]),
        (Schedule(from_s=0.3, kind="periodic", period_s=0.3, on_s=0.1), [3, 6, 9]),
        (Schedule(from_s=0.1, to_s=0.7, kind="periodic", period_s=0.4, on_s=0.2), [1, 2, 5, 6]),
        (Schedule(kind="random", probability=1.0, to_s=0.3), [0, 1, 2]),
    ],
)
def test_an_attack_acts_by_its_schedule(schedule: Schedule, expected: list[int]) -> None:
    assert times_on(schedule) == expected


def test_a_random_schedule_acts_with_its_probability() -> None:
    schedule, rng = Schedule(from_s=1, kind="random", probability=0.3), np.random.default_rng(5)
    on = sum(schedule.active(2.0, rng) for _ in range(4000))
    assert abs(on - 1200) < 5 * np.sqrt(4000 * 0.3 * 0.7)
    # One draw a call, on or not: what comes later does not hang on when the attack begins.
    expected = np.random.default_rng(6).random(3)[2] < 0.3
    rng = np.random.default_rng(6)
    assert [schedule.active(t, rng) for t in (0.0, 0.5, 1.0)] == [False, False, expected]


def test_adjacent_schedules_do_not_overlap() -> None:
    first, second = Schedule(to_s=5), Schedule(from_s=5, to_s=9)
    assert not first.overlaps(second)
    assert not second.overlaps(first)
    assert Schedule(from_s=4, to_s=6).overlaps(first)
    assert Schedule().overlaps(second)
    assert Schedule(from_s=8).overlaps(second)
    assert not Schedule(from_s=9).overlaps(second)


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"from_s": 5, "to_s": 5}, "to_s 5 is not after from_s 5"),
        ({"from_s": float("nan")}, "finite"),
        ({"from_s": -1}, "greater than or equal to 0"),
        ({"kind": "periodic", "period_s": 1}, "a periodic schedule needs its on_s"),
        ({"kind": "periodic", "period_s": 1, "on_s": 2}, "on_s 2 is longer than period_s 1"),
        ({"kind": "random"}, "a random schedule needs its probability"),
        ({"kind": "random", "probability": 0}, r"equal to 0\.000001"),
        ({"probability": 0.5}, "probability is given, but kind is continuous; set kind: random"),
        ({"period_s": 3}, "period_s is given, but kind is continuous; set kind: periodic"),
    ],
)
def test_invalid_schedules_are_refused(keys: dict[str, object], line: str) -> None:
    with pytest.raises(ValidationError, match=line):
        Schedule.model_validate(keys)


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        (
            {"type": "cam-dos", "attackers": {"vehicles": ["a", "ego"]}, "victim": "ego"},
            "ego is both attacker and victim of cam-dos; name another",
        ),
        (
            {"type": "cam-dos-random", "attackers": {"roadside_unit": {"x_m": 1e9, "y_m": 0}}},
            "attackers.roadside_unit.x_m: Input should be less than or equal to 100000",
        ),
        ({"type": "detach", "frames": "::0"}, "the step must be at least 1"),
        ({"type": "detach", "frames": 30}, "is a number to YAML; write it in quotes, such as '0:30'"),
        ({"type": "detach", "parameters": {"ratio": float("nan")}}, "ratio is nan; it must be finite"),
        ({"type": "detach", "parameters": {"ratio": {"a": 1}}}, "ratio is a dict; give a number"),
        ({"type": "cam-replay", "attackers": {"share": 0.1, "vehicles": ["a"]}}, "exactly one of"),
        ({"type": "cam-replay", "attackers": {"vehicles": ["a", "a"]}}, "lists one vehicle twice"),
        ({"type": "cam-replay", "attackers": {"share": float("nan")}}, "finite"),
        ({"type": "no word"}, "pattern"),
        ({"type": 3}, "string"),
        ({}, "Field required"),
    ],
)
def test_invalid_attacks_give_a_one_line_error(keys: dict[str, object], line: str) -> None:
    with pytest.raises(AdvpipeError, match=line) as caught:
        attack_spec(keys)
    assert "\n" not in str(caught.value)


def written(folder: Path, attacks: str) -> str:
    path = folder / "mine.yaml"
    path.write_text(GOOD + attacks, encoding="utf-8")
    return str(path)


def test_an_attack_equals_a_list_of_one_attack(tmp_path: Path) -> None:
    one = load_scenario(written(tmp_path, "attacks: {a: {type: detach, parameters: {ratio: 0.01}}}"))
    many = load_scenario(written(tmp_path, "attacks: {a: [{type: detach, parameters: {ratio: 0.01}}]}"))
    assert one.attacks == many.attacks
    assert one.attacks["a"][0].parameters == {"ratio": 0.01}


def test_the_resolved_scenario_does_not_contain_attacks(tmp_path: Path) -> None:
    attacked = load_scenario(written(tmp_path, "attacks: {a: {type: detach}}"))
    plain = load_scenario(written(tmp_path, ""))
    assert dump_scenario(attacked) == dump_scenario(plain)


BAD = {
    "attacks:\n  x:\n    type: detach\n    tpye: 3\n": (
        r"tpye \(line 7\): detach: unknown key; did you mean 'type'"
    ),
    "attacks:\n  x:\n    - type: detach\n    - type: cam-dos\n      schedule: {from: 3}\n": (
        r"from \(line 8\): cam-dos: unknown key; did you mean 'from_s'"
    ),
    "attacks:\n  x: []\n": r"attacks\.x \(line 5\): lists no attack",
    "attacks:\n  x: 3\n": r"attacks\.x \(line 5\): ",
    "attacks:\n  clean: {type: detach}\n": r"clean has a name that data sets reserve",
    "attacks:\n  a/b: {type: detach}\n": r"pattern",
    "attacks:\n  x: {type: detach, schedule: {from_s: 20}}\n": r"begins at 20 s, but the recording",
    "attacks:\n  x: {type: paa, victim: bob}\n": r"paa names the victim .bob., which is not one of",
}


@pytest.mark.parametrize(("attacks", "line"), BAD.items())
def test_errors_in_a_scenarios_attacks_name_their_place(tmp_path: Path, attacks: str, line: str) -> None:
    with pytest.raises(AdvpipeError, match=line) as caught:
        load_scenario(written(tmp_path, attacks))
    assert "\n" not in str(caught.value)
    assert "more)" not in str(caught.value)


@pytest.mark.oracle
@pytest.mark.parametrize(
    ("attacks", "fits"),
    [
        ("{a: {type: detach, parameters: {ratio: 0.01, objects: [car_1], along_ray: true}}}", True),
        ("{a: [{type: detach}, {type: cam-dos, attackers: {share: 0.2}}]}", True),
        ("{a: []}", False),
        ("{a: {type: detach, tpye: 1}}", False),
        ("{a: {recipe: best}}", False),
        ("{a b: {type: detach}}", False),
    ],
)
def test_the_schema_accepts_one_attack_or_a_list(attacks: str, fits: bool) -> None:
    tree = yaml.safe_load(GOOD + f"attacks: {attacks}\n")
    assert jsonschema.Draft202012Validator(scenario_schema()).is_valid(tree) == fits
