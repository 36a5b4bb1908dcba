"""The report as one HTML file that needs no other file and no network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.row import PLAIN_BASELINE, ResultRow
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.clean import (
    class_table,
    distinct_clean,
    lead,
    of_first_detector,
    strata_tables,
)
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.page import rendered
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.scene import attack_title
from advpipe.stages.evaluate.report.section import ATTACK, CLEAN, OVERVIEW, ReportPicture
from advpipe.stages.evaluate.report.table import lines, lost_of, table_notes

TEMPLATE = Path(__file__).with_name("template.html")


def write_html(
    report: Report,
    summaries: Sequence[Summary],
    pictures: Sequence[ReportPicture],
    path: Path,
    viewer: str = "",
) -> None:
    """Write report.html: tables, pictures, formulas and provenance; viewer: HTML of frames in 3D, or none."""
    page = rendered(
        TEMPLATE.read_text(encoding="utf-8"),
        title=report.origin.clean,
        detectors=report.origin.detectors,
        is_attacked=any(summary.comparison.bag for summary in summaries) or bool(report.sections),
        lines=lines(report),
        notes=table_notes(report),
        warnings=report.warnings,
        lost=lost_of(report),
        viewer=viewer,
        overview=_of(pictures, OVERVIEW, ""),
        clean_sections=[
            {
                "lead": lead(summary),
                "bag": summary.comparison.name,
                "by_class": class_table(summary),
                "strata": strata_tables(summary),
                "pictures": _of(pictures, CLEAN, summary.comparison.name),
            }
            for summary in distinct_clean(of_first_detector(summaries))
        ],
        added=report.sections,
        sections=[
            {
                "title": attack_title(summary.result.attack),
                "pictures": _of(pictures, ATTACK, summary.comparison.name),
                "precisions": precision_rows(summary.result),
            }
            for summary in of_first_detector(summaries)
            if summary.comparison.bag
        ],
        formulas=report.formulas,
        provenance=json.dumps(plain_value(report.origin.record()), indent=2, sort_keys=True),
    )
    path.write_text(page, encoding="utf-8")


def _of(pictures: Sequence[ReportPicture], section: str, bag: str) -> list[ReportPicture]:
    return [picture for picture in pictures if (picture.section, picture.bag) == (section, bag)]


def precision_rows(result: ResultRow) -> list[list[str]]:
    """Average precision by class: class, boxes, then strict, loose and bird's-eye on each kind of cloud."""
    attacked = result.attacked.precisions.ap if result.attacked else {}
    random = result.baselines.get(PLAIN_BASELINE)
    on_each = (result.clean.precisions.ap, attacked, random.metrics.precisions.ap if random else {})
    return [
        [
            name,
            formatted_number(result.boxes[name], 0),
            *(
                formatted_number(found.get((criterion, name)), 3)
                for criterion in ("strict", "loose", "bev")
                for found in on_each
            ),
        ]
        for name in CLASSES
        if name in result.boxes
    ]
