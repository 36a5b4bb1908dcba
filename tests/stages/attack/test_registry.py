"""Attacks by name."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.family_registry import FamilyRegistry
from advpipe.stages.attack.registry import (
    ATTACKS,
    default_budget,
    find_attack,
    refuse_foreign_keys,
    resolved_name,
)
from advpipe.stages.attack.v2x.falsification import Falsification
from advpipe.stages.attack.v2x.stop import SuddenStop


def test_names_in_the_paper():
    named_by = {name: kind.traits.also_known_as for name, kind in ATTACKS.items()}
    papers = {names[0]: name for name, names in named_by.items() if names}
    assert papers == {"rba": "gnss-bias", "paa": "gnss-relocate"}


def test_each_name_has_a_class():
    for attack in ATTACKS:
        assert isinstance(find_attack(attack), type)


@pytest.mark.parametrize(
    ("attack", "name", "family"),
    [
        ("detach", "detach", "lidar"),
        ("cam-replay", "cam-replay", "v2x"),
        ("gnss-drift", "gnss-drift", "gnss"),
        ("rba", "gnss-bias", "gnss"),
        ("gnss-paa", "gnss-relocate", "gnss"),
        ("PAA", "gnss-relocate", "gnss"),
    ],
)
def test_names_and_families(attack, name, family):
    spec = resolved_name(AttackSpec(type=attack))
    assert (spec.type, find_attack(spec.type).family) == (name, family)


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"type": "cam-replay", "recipe": "best"}, "cam-replay has no use for recipe; leave it out"),
        ({"type": "gnss-bias", "frames": "1:2"}, "gnss-bias has no use for frames"),
        ({"type": "detach", "attackers": {"share": 0.1}}, "detach has no use for attackers"),
        ({"type": "gnss-bias", "dcc_reacts": True}, "gnss-bias has no use for dcc_reacts"),
    ],
)
def test_keys_of_another_family_are_refused(keys, line):
    with pytest.raises(AdvpipeError, match=line):
        refuse_foreign_keys(AttackSpec(**keys))


def test_a_class_that_does_not_declare_itself_is_not_registered():
    """Neither an abstract one, nor one with its parent's traits, which are those of another attack."""

    class Slower(SuddenStop):
        pass

    abstract = "Falsification is incomplete: it lacks falsify, traits"
    for kind, line in ((Falsification, abstract), (Slower, "inherits the traits of its parent")):
        registry = FamilyRegistry("v2x", lambda add, kind=kind: add("cam-mine", kind))
        with pytest.raises(AdvpipeError, match=line):
            len(registry)


def test_usual_budgets():
    assert default_budget("detach") == {"ratio": 0.01}
    assert default_budget("perturb") == {"eps_cm": 10.0}
    assert default_budget("rba") == default_budget("cam-dos") == {}
