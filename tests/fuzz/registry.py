"""Every target by name."""

from __future__ import annotations

from importlib import import_module

from tests.fuzz.case import Target

NAMES = (
    "container",
    "cdr",
    "embedded_text",
    "parquet",
    "trajectories",
    "scenario",
    "tar",
    "checkpoint",
    "network",
    "drawing",
    "point_files",
    "recording",
    "command_line",
)
"""Of the modules in `targets/`, each of which holds one `TARGET`."""

WITHOUT_COVERAGE = frozenset({"command_line"})
"""Of those whose calls run in other processes, of which atheris sees nothing."""

PLANTED = "planted"
"""Of the target that the fuzzer itself is tested with."""


def target_named(name: str) -> Target:
    """The target; its module is imported now, so that atheris can instrument what that imports."""
    if name not in (*NAMES, PLANTED):
        raise KeyError(f"no target is named {name!r}; known: {', '.join(NAMES)}")
    target: Target = import_module(f"tests.fuzz.targets.{name}").TARGET
    return target
