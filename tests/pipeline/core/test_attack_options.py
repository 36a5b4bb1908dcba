"""The options of an attack are those of the command line and of the scenario file alike."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields

from advpipe.pipeline.cli.attack import attack_command
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.parameter_source import parameter_words


def test_the_command_line_has_the_same_defaults() -> None:
    parameters = inspect.signature(attack_command).parameters
    for each in fields(AttackOptions):
        assert parameters[each.name].default == each.default, each.name


def test_the_scenario_file_has_the_same_defaults_and_help() -> None:
    sections = AttackSpec.model_fields | Schedule.model_fields
    for each in fields(AttackOptions):
        if each.name in ("seed", "device", "debug"):  # of all attacks: simulation.seed, and options of `run`
            continue
        assert (sections[each.name].description or "").startswith(each.metadata["help"])
        assert sections[each.name].default == each.default or sections[each.name].is_required()
    assert AttackSpec.model_fields["type"].is_required()


def test_the_help_names_every_recipe() -> None:
    words = parameter_words("detach")["recipe"]
    named = set(re.findall(r"[a-z-]+", AttackOptions.__dataclass_fields__["recipe"].metadata["help"]))
    assert {"best", "score-based", "random-best"} <= set(words)
    assert set(words) <= named
