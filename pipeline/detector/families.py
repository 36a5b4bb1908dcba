"""The detector families by name, for `train`, checkpoints and presets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.detector.centerpoint.family import CenterPointFamily
from advpipe.pipeline.detector.family import Family
from advpipe.pipeline.detector.pointpillars.family import PointPillarsFamily
from advpipe.pipeline.detector.second.family import SecondFamily

FAMILIES: Mapping[str, Family] = {
    "second": SecondFamily(),
    "pointpillars": PointPillarsFamily(),
    "centerpoint": CenterPointFamily(),
}


def family_named(name: str) -> Family:
    """The family of that name. Raises UsageError, listing the known ones, for an unknown name."""
    if name not in FAMILIES:
        raise UsageError(f"unknown detector family {short_repr(name)}; {known_names(name, FAMILIES)}")
    return FAMILIES[name]


def shipped_checkpoints() -> dict[str, Path]:
    """The checkpoints that come with the package, by name."""
    return {name: file for family in FAMILIES.values() for name, file in family.shipped.items()}
