"""What shells complete as values of options: names, looked up when somebody presses the tab key."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import typer

DEVICES = ("cpu", "cuda")


def attack_names(incomplete: str) -> list[str]:
    """The registered attacks, of all families."""
    from advpipe.stages.attack import names

    return _beginning(names.attack_names(), incomplete)


def detector_names(incomplete: str) -> list[str]:
    """The shipped detectors."""
    from advpipe.pipeline.detector.families import shipped_checkpoints

    return _beginning(shipped_checkpoints(), incomplete)


def image_detector_names(incomplete: str) -> list[str]:
    """The shipped image detectors."""
    from advpipe.pipeline.image_detector.registry import SHIPPED

    return _beginning([*SHIPPED, "none"], incomplete)


def scenario_names(incomplete: str) -> list[str]:
    """The shipped scenarios."""
    from advpipe.pipeline.core.shipped_scenarios import shipped_scenarios

    return _beginning(shipped_scenarios(), incomplete)


def form_names(incomplete: str) -> list[str]:
    """The forms of data sets that can be imported."""
    from advpipe.stages.import_.options import FORM_NAMES

    return _beginning(FORM_NAMES, incomplete)


def figure_formats(incomplete: str) -> list[str]:
    """The formats that figures can have."""
    from advpipe.stages.evaluate.report.figures import FORMATS

    return _beginning(FORMATS, incomplete)


def defence_names(incomplete: str) -> list[str]:
    """The defences, without their parameters, and the words for several."""
    from advpipe.pipeline.defences.names import defence_names as names

    return _beginning([*names(), "default", "all", "none"], incomplete)


def attack_check_names(incomplete: str) -> list[str]:
    """The checks that tell attacked clouds from clean ones."""
    from advpipe.pipeline.attack_detection import names

    return _beginning(
        (*names.POINT_CHECKS, *names.BOX_CHECKS, *names.SEQUENCE_CHECKS, names.ALL, names.NONE), incomplete
    )


def recipe_names(context: typer.Context, incomplete: str) -> list[str]:
    """The recipes of the attack that `--type` names."""
    from advpipe.pipeline.core.attack_options import AttackOptions
    from advpipe.stages.attack.parameter_source import parameter_words

    words = parameter_words(context.params.get("type") or AttackOptions.type)
    return _beginning(words.get("recipe", ()), incomplete)


def sweep_recipes(incomplete: str) -> list[str]:
    """The recipes of the attacks of a sweep; several are separated by commas."""
    from advpipe.pipeline.core.attack_options import AttackOptions
    from advpipe.stages.attack.parameter_source import parameter_words

    done, comma, last = incomplete.rpartition(",")
    recipes = parameter_words(AttackOptions.type)["recipe"]
    return [f"{done}{comma}{name}" for name in _beginning(recipes, last)]


def device_names(incomplete: str) -> list[str]:
    """The devices that a detector may compute on, of GPUs the first."""
    return _beginning(DEVICES, incomplete)


def picture_formats(incomplete: str) -> list[str]:
    """The formats of a picture of a bag."""
    from advpipe.pipeline.core.picture_file import FORMATS

    return _beginning((one.removeprefix(".") for one in FORMATS), incomplete)


def family_names(incomplete: str) -> list[str]:
    """The families of detectors."""
    from advpipe.pipeline.detector.families import FAMILIES

    return _beginning(FAMILIES, incomplete)


def preset_names(incomplete: str) -> list[str]:
    """The presets of all families of detectors."""
    from advpipe.pipeline.detector.families import FAMILIES

    names = dict.fromkeys(name for family in FAMILIES.values() for name in family.presets)
    return _beginning(names, incomplete)


def words_of(known: Iterable[str]) -> Callable[[str], list[str]]:
    """Completes one of these words."""

    def complete(incomplete: str) -> list[str]:
        return _beginning(known, incomplete)

    return complete


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
