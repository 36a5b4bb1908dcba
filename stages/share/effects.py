"""What the reports of a data set say about its attacks, as small tables for its card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from advpipe.pipeline.dataset.layout import REPORT_NAME
from advpipe.pipeline.dataset.reports import read_report
from advpipe.pipeline.errors import AdvpipeError

NOTHING = "–"


class EffectTable(NamedTuple):
    """A title, column heads, and lines of as many cells."""

    title: str
    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]


def effect_tables(reports: Sequence[Path]) -> list[EffectTable]:
    """Of each report: detection, localisation and V2X, as far as it has them.

    Raises AdvpipeError for a report.json that is none.
    """
    tables = []
    for report in reports:
        document = read_report(report / REPORT_NAME)
        for title, key, columns in _TABLES:
            try:
                records = [record for record in document.get(key) or () if record.get("bag")]
                lines = tuple(
                    (str(record["bag"]), *(show(record) for show in columns.values())) for record in records
                )
            except (LookupError, TypeError, ValueError, AttributeError):
                raise AdvpipeError(
                    f"{report / REPORT_NAME}: its {key} are none of this version's; evaluate again with "
                    "--overwrite"
                ) from None
            if lines:
                tables.append(EffectTable(f"{title} ({report.name})", ("bag", *columns), lines))
    return tables


def banners(reports: Sequence[Path]) -> list[str]:
    """What the reports want to be read before any figure, such as that the detector was trained on the map.

    Raises AdvpipeError for a report.json that is none.
    """
    told: dict[str, None] = {}
    for report in reports:
        texts = read_report(report / REPORT_NAME).get("banners")
        told |= {text: None for text in texts if isinstance(text, str)} if isinstance(texts, list) else {}
    return list(told)


def _figure(key: str, digits: int, factor: float = 1.0) -> Any:
    def show(record: Mapping[str, Any]) -> str:
        value = record.get(key)
        return f"{value * factor:.{digits}f}" if isinstance(value, int | float) else NOTHING

    return show


def _ratio(record: Mapping[str, Any]) -> str:
    """Such as `37.1 (28.8…44.6)`."""
    value, interval = record.get("map_ratio_percent"), record.get("map_ratio_ci95")
    if not isinstance(value, int | float):
        return NOTHING
    return f"{value:.1f}" + (
        f" ({interval[0]:.1f}…{interval[1]:.1f})" if interval and None not in interval else ""
    )


def _lost(record: Mapping[str, Any]) -> str:
    return f"{record.get('lost_objects', NOTHING)} of {record.get('objects_found_clean', NOTHING)}"


_TABLES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    (
        "Effect on detection",
        "rows",
        {
            "frames": _figure("frames", 0),
            "mAP clean": _figure("map_clean", 3),
            "mAP attacked": _figure("map_adv", 3),
            "mAP ratio % (95 %)": _ratio,
            "one random draw, same budget": _figure("baseline_map_ratio_percent", 1),
            "objects lost, loose overlap": _lost,
            "score at least": _figure("working_score", 2),
            "Chamfer distance m²": _figure("chamfer_distance_m2", 4),
        },
    ),
    (
        "Effect on localisation",
        "localisation",
        {
            "vehicle": lambda record: str(record.get("vehicle", "")),
            "mean error clean m": _figure("clean_mean_m", 2),
            "mean error attacked m": _figure("adv_mean_m", 2),
            "found by the innovation test %": _figure("detection_rate", 1, 100),
        },
    ),
    (
        "Effect on V2X",
        "v2x",
        {
            "receiver": lambda record: str(record.get("vehicle", "")),
            "messages": _figure("messages", 0),
            "lies": _figure("lies", 0),
            "F1 of misbehaviour detection": _figure("f1", 3),
        },
    ),
)
