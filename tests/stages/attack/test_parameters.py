"""Parameters by the constructors of attacks: ours, and some of a user's own."""

from __future__ import annotations

import sys
import types

import pytest

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack import contradictions
from advpipe.stages.attack.parameters import (
    build_lidar_attack,
    known_parameters,
    resolved_parameters,
    resolved_recipe,
)
from advpipe.stages.attack.registry import ATTACKS, find_attack, source_sha256


class Mine:
    def __init__(self, *, size_m: float, mode: str = "soft", times: int = 3, hard: bool = False, ids=()):
        self.given = (size_m, mode, times, hard, ids)

    def __call__(self, cloud, boxes, detector, rng):
        raise NotImplementedError


class NotCallable:
    def __init__(self, *, size_m: float):
        pass


@pytest.fixture(autouse=True)
def _my_module(monkeypatch):
    module = types.ModuleType("my_own")
    module.Mine, module.NotCallable, module.number = Mine, NotCallable, 3
    monkeypatch.setitem(sys.modules, "my_own", module)


def mine(**parameters):
    return AttackSpec(type="my_own:Mine", parameters=parameters)


def test_defaults_are_filled_in_in_the_constructors_order():
    resolved = resolved_parameters(mine(hard=True, size_m=2))
    assert list(resolved.items()) == [
        ("size_m", 2.0),
        ("mode", "soft"),
        ("times", 3),
        ("hard", True),
        ("ids", ()),
    ]
    assert build_lidar_attack(mine(size_m=2, ids=["a", "b"])).given == (2.0, "soft", 3, False, ("a", "b"))


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({}, "my_own:Mine: size_m is missing; pass --set size_m=VALUE"),
        ({"size": 3}, "unknown parameter 'size'; known: size_m, mode, times, hard, ids"),
        ({"size_m": "wide"}, "size_m is 'wide': Input should be a valid number"),
        ({"size_m": True}, "size_m is True: Input should be a valid number"),
        ({"size_m": 1, "times": 2.5}, "times is 2.5: Input should be a valid integer"),
        ({"size_m": 1, "mode": 3}, "mode is 3: Input should be a valid string"),
        ({"size_m": 1, "hard": "yes"}, "hard is 'yes': Input should be a valid boolean"),
    ],
)
def test_bad_parameters_are_one_line(parameters, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        resolved_parameters(mine(**parameters))
    assert "\n" not in str(caught.value)


def test_recipes():
    assert resolved_recipe(AttackSpec(type="detach")) == "best"
    assert resolved_recipe(AttackSpec(type="detach", recipe="paper")) == "paper"
    assert resolved_recipe(mine(size_m=1)) == ""
    with pytest.raises(AdvpipeError, match="my_own:Mine has no recipes; leave out 'best'"):
        resolved_recipe(AttackSpec(type="my_own:Mine", recipe="best"))


@pytest.mark.parametrize(
    ("word", "line"),
    [
        ("detatch", r"unknown attack 'detatch'; known: .*detach, .*cam-replay.*, or module:Class"),
        ("my_own:Missing", "cannot load attack my_own:Missing: "),
        ("no_such_module:Mine", "cannot load attack no_such_module:Mine: No module named"),
        ("my_own:number", "my_own:number is no class"),
    ],
)
def test_unknown_attacks(word, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        find_attack(word)
    assert "\n" not in str(caught.value)


def test_an_instance_that_cannot_be_called_is_no_attack():
    with pytest.raises(AdvpipeError, match="cannot be called with a cloud"):
        build_lidar_attack(AttackSpec(type="my_own:NotCallable", parameters={"size_m": 1}))


@pytest.mark.parametrize("word", ATTACKS)
def test_every_word_leads_to_an_attack(word):
    assert AttackSpec(type=word).type == word  # none of ours is the paper's name for another
    parameters = known_parameters(word)
    assert "context" not in parameters
    assert source_sha256(word) == ""


def test_contradictions_speak_of_attacks_that_there_are():
    assert set(contradictions.SETS) <= set(ATTACKS)


def test_an_attack_of_ones_own_is_told_apart_by_its_file():
    assert len(source_sha256("my_own:Mine")) == 64


def test_stopped_vehicles_stand_in_one_direction():
    """`cam-eventual-stop` freezes the heading, so another lie about it contradicts."""
    assert "heading" in contradictions.SETS["cam-eventual-stop"] & contradictions.SETS["cam-heading-rotating"]
