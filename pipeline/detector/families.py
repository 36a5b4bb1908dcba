"""The families of detectors that `train`, checkpoints and presets know by their names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.detector.family import Family
from advpipe.pipeline.detector.second.family import SecondFamily

FAMILIES: Mapping[str, Family] = {"second": SecondFamily()}


def family_named(name: str) -> Family:
    """The family of that name, or an error that lists the known ones."""
    if name not in FAMILIES:
        raise UsageError(f"unknown detector family {short_repr(name)}; known: {', '.join(FAMILIES)}")
    return FAMILIES[name]


def shipped_checkpoints() -> dict[str, Path]:
    """The checkpoints that come with the package, by name."""
    return {name: file for family in FAMILIES.values() for name, file in family.shipped.items()}
