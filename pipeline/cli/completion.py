"""What shells complete as values of options: names, looked up when somebody presses the tab key."""

from __future__ import annotations

from collections.abc import Iterable


def attack_names(incomplete: str) -> list[str]:
    """The registered attacks, of all families."""
    from advpipe.stages.attack import names

    return _beginning(names.attack_names(), incomplete)


def detector_names(incomplete: str) -> list[str]:
    """The shipped detectors."""
    from advpipe.pipeline.detector.families import shipped_checkpoints

    return _beginning(shipped_checkpoints(), incomplete)


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
    """The defences, without their parameters."""
    from advpipe.pipeline.defences.registry import DEFENCES

    return _beginning(DEFENCES, incomplete)


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
