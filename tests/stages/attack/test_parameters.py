"""Parameters by the constructors of attacks: ours, and some of a user's own."""

from __future__ import annotations

import sys
import types

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack import parameters as parameters_of
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, LidarTraits
from advpipe.stages.attack.lidar.build import build_lidar_attack, count_of
from advpipe.stages.attack.plugin import source_sha256
from advpipe.stages.attack.registry import ATTACKS, find_attack

BUDGET = Budget(title="Size in m", parameter="size_m", unit="m")


def known_parameters(attack):
    return parameters_of.known_parameters(find_attack(attack))


def resolved_parameters(spec):
    return parameters_of.resolved_parameters(spec, find_attack(spec.type))


def resolved_recipe(spec):
    return parameters_of.resolved_recipe(spec, find_attack(spec.type))


class Mine(LidarAttack):
    traits = LidarTraits(budget=BUDGET)
    bounds = {}  # noqa: RUF012

    def __init__(self, *, size_m: float, mode: str = "soft", times: int = 3, hard: bool = False, ids=()):
        self.given = (size_m, mode, times, hard, ids)

    def __call__(self, cloud, boxes, detector, rng):
        raise AssertionError("nobody asks for this here")


class Stranger(Mine):
    """It takes a recipe, and tells of a parameter that it does not have."""

    traits = LidarTraits(budget=BUDGET, only_for={"tries": ("slow",)})

    def __init__(self, *, size_m: float, recipe: str = "quick"):
        super().__init__(size_m=size_m)


class NotCallable(LidarAttack):
    traits = LidarTraits(budget=BUDGET)
    bounds = {}  # noqa: RUF012

    def __init__(self, *, size_m: float):
        pass


class Judging(Mine):
    traits = LidarTraits(budget=BUDGET)
    query_budget = 2.5


class NoTraits(Mine):
    """It has those of its parent alone."""


class OtherTraits(Mine):
    traits = GnssTraits()


class NoFamily:
    def __call__(self, cloud, boxes, detector, rng):
        raise AssertionError("nobody asks for this here")


class NotBegun(GnssAttack):
    traits = GnssTraits()


class Heir(Mine):
    traits = LidarTraits(budget=BUDGET)

    def __init__(self, *, size_m: float = 5.0, colour: str = "red", **others):
        super().__init__(size_m=size_m, **others)


@pytest.fixture(autouse=True)
def _my_module(monkeypatch):
    module = types.ModuleType("my_own")
    for one in (Mine, NotCallable, NoTraits, OtherTraits, NoFamily, NotBegun, Heir, Stranger, Judging):
        setattr(module, one.__name__, one)
    module.number = 3
    monkeypatch.setitem(sys.modules, "my_own", module)


def mine(**parameters):
    return AttackSpec(type="my_own:Mine", parameters=parameters)


def test_what_a_constructor_hands_on_is_its_parents():
    known = known_parameters("my_own:Heir")
    assert list(known.items()) == [
        ("size_m", 5.0),
        ("colour", "red"),
        ("mode", "soft"),
        ("times", 3),
        ("hard", False),
        ("ids", ()),
    ]
    with pytest.raises(AdvpipeError, match="times is 'x'"):
        resolved_parameters(AttackSpec(type="my_own:Heir", parameters={"times": "x"}))
    assert {"margin_m", "from_speed_mps", "length_m", "dcc"} <= set(known_parameters("cam-ghost-stop"))


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
        ({}, "my_own:Mine: size_m is missing; pass size_m"),
        ({"size": 3}, "unknown parameter 'size'; did you mean 'size_m'"),
        ({"size_m": "wide"}, "size_m is 'wide': Input should be a valid number"),
        ({"size_m": True}, "size_m is True: Input should be a valid number"),
        ({"size_m": 1, "times": 2.5}, "times is 2.5: Input should be a valid integer"),
        ({"size_m": 1, "mode": 3}, "mode is 3: Input should be a valid string"),
        ({"size_m": 1, "hard": "yes"}, "hard is 'yes': Input should be a valid boolean"),
        ({"size_m": 1, "ids": ()}, "ids is empty; give it a value, or leave it out"),
        ({"size_m": 1, "mode": ""}, "mode is empty; give it a value, or leave it out"),
    ],
)
def test_bad_parameters_are_one_line(parameters, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        resolved_parameters(mine(**parameters))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("attack", "parameters", "line"),
    [
        (
            "perturb",
            {"eps_cm": 1, "weight": 1e9},
            "weight is 1000000000.0: it may be 1e[+]06",
        ),
        ("attach", {"eps_m": 0.1, "decay_m": 1e7}, "decay_m is 10000000.0: it may be 1e[+]06 at most"),
        ("cam-drop", {"braking_mps2": 1e4}, "braking_mps2 is 10000.0: it may be 1000 at most"),
        ("cam-sybil-grid", {"jitter_m": 1e9}, "jitter_m is 1000000000.0: it may be 1e[+]06 at most"),
        ("detach", {"ratio": 0.1, "max_points": 10**12}, "max_points is 1000000000000: it may be"),
    ],
)
def test_parameters_of_ours_are_bounded_by_their_units(attack, parameters, line):
    with pytest.raises(AdvpipeError, match=line):
        resolved_parameters(AttackSpec(type=attack, parameters=parameters))


def test_texts_stand_for_numbers_where_numbers_are_taken():
    given = {"ratio": "1e-2", "rounds": "1e1", "objects": "1e1"}
    found = resolved_parameters(AttackSpec(type="detach", parameters=given))
    assert (found["ratio"], found["rounds"], found["objects"]) == (0.01, 10, ("1e1",))
    assert type(found["rounds"]) is int


@pytest.mark.parametrize(
    ("objects", "names"),
    [("suv.3", ("suv.3",)), (["a", "b"], ("a", "b")), (7, ("7",)), ([7, "a"], ("7", "a"))],
)
def test_one_name_stands_for_a_list_of_it(objects, names):
    given = AttackSpec(type="detach", parameters={"ratio": 0.1, "objects": objects})
    assert resolved_parameters(given)["objects"] == names
    assert build_lidar_attack(given).constraints.objects == names


@pytest.mark.parametrize("objects", [None, 1.5, True, ["a", None]])
def test_what_is_no_name_is_refused(objects):
    with pytest.raises(AdvpipeError, match=r"detach: objects is .*should be a valid string"):
        resolved_parameters(AttackSpec(type="detach", parameters={"ratio": 0.1, "objects": objects}))


def test_recipes():
    assert resolved_recipe(AttackSpec(type="detach")) == "best"
    assert resolved_recipe(AttackSpec(type="detach", recipe="paper")) == "paper"
    assert resolved_recipe(mine(size_m=1)) == ""
    with pytest.raises(AdvpipeError, match="my_own:Mine has no recipes; leave out 'best'"):
        resolved_recipe(AttackSpec(type="my_own:Mine", recipe="best"))
    with pytest.raises(AdvpipeError, match="detach: the recipe is empty"):
        resolved_recipe(AttackSpec(type="detach", recipe=""))


def test_an_option_that_an_attack_does_not_have_is_nobodys():
    assert callable(build_lidar_attack(AttackSpec(type="my_own:Stranger", parameters={"size_m": 1.0})))


@pytest.mark.parametrize(
    ("attack", "recipe", "parameters", "line"),
    [
        (
            "attach",
            "paper",
            {"eps_m": 1.0, "intensity": True},
            "paper does not use intensity; .*: best,",
        ),
        ("attach", "paper", {"eps_m": 1.0, "rounds": 3}, "recipe paper does not use rounds"),
        (
            "attach",
            "best",
            {"eps_m": 1.0, "weight": 2.0},
            "best does not use weight; .*does: paper",
        ),
        ("perturb", "paper", {"eps_cm": 1.0, "intensity": True}, "recipe paper does not use intensity"),
        ("perturb", "random", {"eps_cm": 1.0, "steps": 9}, "recipe random does not use steps"),
        ("detach", "random-near", {"ratio": 0.1, "rounds": 9}, "recipe random-near does not use rounds"),
        (
            "perturb",
            "paper",
            {"eps_cm": 1.0, "goal": "hide"},
            "paper does not use goal; .*: best,",
        ),
        ("detach", "paper", {"ratio": 0.1, "goal": "hide"}, "recipe paper does not use goal"),
        ("attach", "random", {"eps_m": 1.0, "goal": "hide"}, "recipe random does not use goal"),
    ],
)
def test_what_a_recipe_would_pass_over_is_refused(attack, recipe, parameters, line):
    with pytest.raises(AdvpipeError, match=line):
        build_lidar_attack(AttackSpec(type=attack, recipe=recipe, parameters=parameters))
    known = known_parameters(attack)
    usual = {name: known[name] for name in parameters if not name.startswith(("eps", "ratio"))}
    build_lidar_attack(AttackSpec(type=attack, recipe=recipe, parameters=parameters | usual))


def test_the_query_budget_of_attacks():
    def queries(attack, recipe, **parameters):
        spec = AttackSpec(type=attack, recipe=recipe, parameters=parameters)
        return count_of(build_lidar_attack(spec), "query_budget")

    assert queries("perturb", "best", eps_cm=1.0) == queries("perturb", "random-best", eps_cm=1.0) == 24
    assert queries("perturb", "robust", eps_cm=1.0, steps=7) == 7
    assert queries("perturb", "paper", eps_cm=1.0) == queries("attach", "paper", eps_m=1.0) == 1
    assert queries("detach", "best", ratio=0.1) == queries("attach", "best", eps_m=1.0) == 10 + 3
    assert count_of(build_lidar_attack(mine(size_m=2)), "query_budget") is None
    wrong = build_lidar_attack(AttackSpec(type="my_own:Judging", parameters={"size_m": 1}))
    with pytest.raises(AdvpipeError, match=r"Judging: query_budget is 2\.5, but must be a whole number"):
        count_of(wrong, "query_budget")


@pytest.mark.parametrize(
    ("attack", "line"),
    [
        ("detatch", r"unknown attack 'detatch'; did you mean 'detach'\? \(or module:Class"),
        ("my_own:Missing", "cannot load attack my_own:Missing: "),
        (
            "no_such_module:Mine",
            "cannot load attack no_such_module:Mine: ModuleNotFoundError: No",
        ),
        ("my_own:number", "my_own:number is not a class"),
    ],
)
def test_unknown_attacks(attack, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        find_attack(attack)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("NotCallable", "NotCallable is incomplete: it lacks __call__; see its base class"),
        ("NotBegun", "NotBegun is incomplete: it lacks begin; see its base class"),
        ("NoTraits", "NoTraits inherits the traits of its parent; define its own"),
        ("OtherTraits", "OtherTraits: traits are GnssTraits, not LidarTraits"),
        (
            "NoFamily",
            "NoFamily is not an attack; let it inherit from LidarAttack, V2xAttack, GnssAttack, RadarAttack",
        ),
    ],
)
def test_what_does_not_declare_itself_is_refused(name, line):
    with pytest.raises(AdvpipeError, match=line) as caught:
        find_attack(f"my_own:{name}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("attack", ATTACKS)
def test_every_name_leads_to_an_attack(attack):
    parameters = known_parameters(attack)
    assert "context" not in parameters
    assert source_sha256(find_attack(attack)) == ""


def test_an_attack_of_ones_own_is_distinguished_by_its_file():
    assert len(source_sha256(find_attack("my_own:Mine"))) == 64


def test_stopped_vehicles_stand_in_one_direction():
    """`cam-eventual-stop` freezes the heading, so another lie about it contradicts."""
    for attack in ("cam-eventual-stop", "cam-heading-rotating"):
        assert "heading" in find_attack(attack).traits.untrue
