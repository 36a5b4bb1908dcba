"""The attacks' effects from a data set's reports, as small tables for its card."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from advpipe.pipeline.core.document import Document
from advpipe.pipeline.dataset.layout import REPORT_NAME
from advpipe.pipeline.dataset.reports import DetectionRow, read_report

NOTHING = "–"


class EffectTable(NamedTuple):
    """A title, column heads, and lines of as many cells."""

    title: str
    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]


def effect_tables(reports: Sequence[Path]) -> list[EffectTable]:
    """One table for detection, localisation and V2X of each report, if it has rows for it.

    Raises AdvpipeError for an invalid report.
    """
    tables = []
    for report in reports:
        document = read_report(report / REPORT_NAME)
        for title, key, columns in _TABLES:
            lines = tuple(
                (record.bag, *(show(record) for show in columns.values()))
                for record in getattr(document, key)
                if record.bag
            )
            if lines:
                tables.append(EffectTable(f"{title} ({report.name})", ("bag", *columns), lines))
    return tables


def report_warnings(reports: Sequence[Path]) -> list[str]:
    """The warnings of the reports, such as that the detector was trained on the map.

    Raises AdvpipeError for an invalid report.
    """
    found: dict[str, None] = {}
    for report in reports:
        found |= dict.fromkeys(read_report(report / REPORT_NAME).warnings)
    return list(found)


def _value(key: str, digits: int, factor: float = 1.0) -> Any:
    def show(record: Document) -> str:
        value = getattr(record, key)
        return NOTHING if value is None else f"{value * factor:.{digits}f}"

    return show


def _ratio(record: DetectionRow) -> str:
    """Such as `37.1 (28.8…44.6)`, or why there is none."""
    value, interval = record.map_ratio_percent, record.map_ratio_ci95
    if value is None:
        return f"not meaningful: {record.map_ratio_reason}" if record.map_ratio_reason else NOTHING
    low, high = interval or (None, None)
    return f"{value:.1f}" + (f" ({low:.1f}…{high:.1f})" if low is not None and high is not None else "")


def _lost(record: DetectionRow) -> str:
    lost, found = record.lost_objects, record.objects_found_clean
    return f"{NOTHING if lost is None else lost} of {NOTHING if found is None else found}"


_TABLES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    (
        "Effect on detection",
        "rows",
        {
            "frames": _value("frames", 0),
            "mAP clean": _value("map_clean", 3),
            "mAP attacked": _value("map_adv", 3),
            "mAP ratio % (95 %)": _ratio,
            "random-best, same budget": _value("random_best_map_ratio_percent", 1),
            "one random draw": _value("baseline_map_ratio_percent", 1),
            "objects lost, loose overlap": _lost,
            "score at least": _value("working_score", 2),
            "Chamfer distance m²": _value("chamfer_distance_m2", 4),
        },
    ),
    (
        "Effect on localisation",
        "localisation",
        {
            "vehicle": lambda record: record.vehicle,
            "mean error clean m": _value("clean_mean_m", 2),
            "mean error attacked m": _value("adv_mean_m", 2),
            "found by the innovation test %": _value("detection_rate", 1, 100),
        },
    ),
    (
        "Effect on V2X",
        "v2x",
        {
            "receiver": lambda record: record.vehicle,
            "messages": _value("messages", 0),
            "false messages": _value("false_messages", 0),
            "F1 of misbehaviour detection": _value("f1", 3),
        },
    ),
)
