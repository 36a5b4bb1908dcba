"""The parameters that shells complete are those of the attacks' classes."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.declared import declaration_of
from advpipe.stages.attack.parameter_source import SWITCH, parameter_words
from advpipe.stages.attack.parameters import known_parameters, parameter_types, resolved_recipe
from advpipe.stages.attack.registry import ATTACKS, default_budget, find_attack


@pytest.mark.parametrize("name", ATTACKS)
def test_they_are_those_of_the_class(name: str) -> None:
    attack_class, words = find_attack(name), parameter_words(name)
    assert set(words) - {"recipe", "preset"} == set(known_parameters(attack_class))
    assert words.get("preset", ()) == tuple(attack_class.presets)
    assert bool(words.get("recipe")) == bool(resolved_recipe(attack_spec({"type": name}), attack_class))
    types = parameter_types(attack_class)
    assert {key for key, known in words.items() if known == SWITCH} == {
        key for key, known in types.items() if set(known) == {bool}
    }


@pytest.mark.parametrize("name", [name for name in ATTACKS if default_budget(name)])
def test_words_of_an_attack_on_clouds_are_taken_and_others_refused(name: str) -> None:
    words = parameter_words(name)
    for goal in words["goal"]:
        declaration_of(attack_spec({"type": name, "parameters": {**default_budget(name), "goal": goal}}))
    for recipe in words["recipe"]:
        declaration_of(attack_spec({"type": name, "parameters": default_budget(name), "recipe": recipe}))
    with pytest.raises(UsageError, match=f"known: {', '.join(words['goal'])}$"):
        declaration_of(attack_spec({"type": name, "parameters": {**default_budget(name), "goal": "x"}}))
    with pytest.raises(UsageError, match=f"known: {', '.join(words['recipe'])}$"):
        declaration_of(attack_spec({"type": name, "parameters": default_budget(name), "recipe": "x"}))


def test_words_are_found_in_every_way_that_classes_have() -> None:
    assert parameter_words("gnss-jump")["mode"] == ("glitch", "step")
    assert parameter_words("cam-replay")["identity"] == ("own", "theirs")  # by a base class
    assert parameter_words("cam-out-of-range")["field"][:2] == ("all", "position")
    assert parameter_words("none") == {}
