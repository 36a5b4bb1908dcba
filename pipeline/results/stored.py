"""Rows of a report, read back from their flat records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar, get_type_hints

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.results.metrics import (
    CRITERIA,
    BaselineMetrics,
    CleanMeans,
    CleanMetrics,
    CloudMetrics,
    Interval,
    Precisions,
    RecountedMetrics,
    precision_key,
)
from advpipe.pipeline.results.row import AttackRecord, FrameCounts, ResultRow

Metrics = TypeVar("Metrics")
Stored = Mapping[str, Any]


def stored_row(stored: Stored) -> ResultRow:
    """The row whose `record` was written as JSON, with the precision that JSON kept; NaN for null.

    Raises KeyError, TypeError or ValueError for what is no such record.
    """
    has_attack = stored["points_added"] is not None
    return ResultRow(
        bag=str(stored["bag"]),
        detector=str(stored["detector"]),
        attack=_fields_from(AttackRecord, stored),
        counts=_fields_from(FrameCounts, stored),
        boxes={name: _whole(stored[f"boxes_{name}"]) for name in CLASSES if f"boxes_{name}" in stored},
        clean=CleanMetrics(
            {each: _clean_means(stored, each) for each in CRITERIA}, _precisions(stored, "clean")
        ),
        attacked=_cloud_metrics(stored) if has_attack else None,
        recounted=_fields_from(RecountedMetrics, stored) if has_attack else None,
        baselines={name: _baseline(stored, name) for name in stored["baselines"]},
        significant_vs_random=stored["significant_vs_random"],
        notes=tuple(map(str, stored["notes"])),
    )


def _clean_means(stored: Stored, criterion: str) -> CleanMeans:
    prefix = "" if criterion == "strict" else f"{criterion}_"
    return CleanMeans(
        map_r40=_real(stored[f"map_{prefix}clean"]),
        map_r40_ci95=_interval(stored[f"map_{prefix}clean_ci95"]),
        map_r11=_real(stored[f"map_{prefix}r11_clean"]),
    )


def _baseline(stored: Stored, name: str) -> BaselineMetrics:
    loose = f"map_loose_ratio_delta_points_vs_{name}"  # absent in older reports
    return BaselineMetrics(
        metrics=_cloud_metrics(stored, f"{name}_"),
        map_ratio_delta_points=_real(stored[f"map_ratio_delta_points_vs_{name}"]),
        map_ratio_delta_points_ci95=_interval(stored[f"map_ratio_delta_points_vs_{name}_ci95"]),
        is_significant=stored[f"significant_vs_{name}"],
        map_loose_ratio_delta_points=_real(stored.get(loose)),
        map_loose_ratio_delta_points_ci95=_interval(stored.get(f"{loose}_ci95")),
    )


def _cloud_metrics(stored: Stored, prefix: str = "") -> CloudMetrics:
    return _fields_from(CloudMetrics, stored, prefix, precisions=_precisions(stored, "adv", prefix))


def _precisions(stored: Stored, condition: str, prefix: str = "") -> Precisions:
    keys = {
        (criterion, name): prefix + precision_key(criterion, name, condition)
        for criterion in CRITERIA
        for name in CLASSES
    }
    strict = {name: key for (criterion, name), key in keys.items() if criterion == "strict" and key in stored}
    return Precisions(
        {of: _real(stored[key]) for of, key in keys.items() if key in stored},
        {name: _interval(stored[f"{key}_ci95"]) for name, key in strict.items()},
    )


def _fields_from(kind: type[Metrics], stored: Stored, prefix: str = "", **nested: object) -> Metrics:
    """A dataclass from the keys that its fields have in a record; nested: those that have none. A field with
    a default may be absent."""
    hints = {
        name: hint
        for name, hint in get_type_hints(kind).items()
        if name not in nested and (prefix + name in stored or not hasattr(kind, name))
    }
    return kind(
        **nested, **{name: _READ.get(hint, _as_is)(stored[prefix + name]) for name, hint in hints.items()}
    )


def _real(value: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return value


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError(f"{value!r} is no count")
    return value


def _interval(value: Any) -> Interval:
    if value is None:
        return None
    low, high = map(_real, value)
    return low, high


def _as_is(value: Any) -> Any:
    return value


_READ: Mapping[Any, Any] = {float: _real, int: _whole, Interval: _interval, tuple[str, ...]: tuple}
"""How the value of a field of each type is read; others are what JSON gives."""
