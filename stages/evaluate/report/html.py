"""The report as one HTML file that needs no other file and no network."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from advpipe.pipeline.core.html_page import rendered
from advpipe.pipeline.core.text import escape_unprintable
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.row import RANDOM_BEST, ResultRow
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.clean import (
    class_table,
    distinct_clean,
    lead,
    of_first_detector,
    strata_tables,
)
from advpipe.stages.evaluate.report.headline import FirstScreen, first_screen
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.outcomes import outcomes_table
from advpipe.stages.evaluate.report.page_table import shown_table
from advpipe.stages.evaluate.report.pictures import WORST
from advpipe.stages.evaluate.report.report import Report
from advpipe.stages.evaluate.report.scene import attack_title, worst_frames
from advpipe.stages.evaluate.report.section import (
    ATTACK,
    CLEAN,
    FIRST_SCREEN,
    OVERVIEW,
    ReportPicture,
    Table,
)
from advpipe.stages.evaluate.report.table import lost_of, results_table, table_notes

TEMPLATE, STYLE = (Path(__file__).with_name(name) for name in ("template.html", "page.css"))

TIMELINE = "coordinated"
"""The section whose pictures, on one time axis, stand at the top."""


def write_html(
    report: Report,
    summaries: Sequence[Summary],
    pictures: Sequence[ReportPicture],
    path: Path,
    viewer: str = "",
) -> None:
    """Write report.html: tables, pictures, formulas and provenance; viewer: HTML of frames in 3D, or none."""
    own, first = of_first_detector(summaries), first_screen(report)
    cleans = distinct_clean(own)
    sections = [_attack_section(summary, pictures) for summary in own if summary.comparison.bag]
    clean_sections = [_clean_section(summary, pictures, len(cleans)) for summary in cleans]
    overview = _of(pictures, OVERVIEW, "")
    timelines = [each for section in report.sections if section.key == TIMELINE for each in section.pictures]
    page = rendered(
        TEMPLATE.read_text(encoding="utf-8"),
        {
            "shown": partial(shown_table, formulas=report.formulas),
            "anchor": _anchor,
            "unbroken": _unbroken,
        },
        css=Markup(STYLE.read_text(encoding="utf-8")),
        first=first,
        contents=_contents(report, sections, clean_sections, overview, viewer),
        is_clean=any(headline.section == "clean" for headline in first.headlines),
        lines=results_table(report),
        notes=table_notes(report),
        warnings=report.warnings,
        lost=lost_of(report),
        viewer=viewer,
        overview=overview,
        worst=_worst(first, report, pictures),
        timelines=timelines,
        clean_sections=clean_sections,
        added=report.sections,
        sections=sections,
        formulas=report.formulas,
        definitions=report.definitions,
        provenance=json.dumps(plain_value(report.origin.record()), indent=2, sort_keys=True),
    )
    path.write_text(page, encoding="utf-8")


def _attack_section(summary: Summary, pictures: Sequence[ReportPicture]) -> dict[str, Any]:
    """Frames before and after an attack, and what it does to average precision."""
    outcomes = outcomes_table(worst_frames(summary, WORST), summary.min_score)
    return {
        "id": f"bag-{_anchor(summary.comparison.name)}",
        "title": attack_title(summary.result.attack),
        "pictures": _of(pictures, ATTACK, summary.comparison.name),
        "tables": [
            *([outcomes] if outcomes.lines else []),
            _precision_table(summary.result),
        ],
    }


def _clean_section(summary: Summary, pictures: Sequence[ReportPicture], count: int) -> dict[str, Any]:
    frames = f", frames of {summary.comparison.name}" if count > 1 else ""
    return {
        "title": f"The detector on the clean clouds{frames}",
        "lead": lead(summary),
        "by_class": class_table(summary),
        "strata": strata_tables(summary),
        "pictures": _of(pictures, CLEAN, summary.comparison.name),
    }


def _contents(
    report: Report,
    sections: Sequence[Mapping[str, Any]],
    clean_sections: Sequence[Mapping[str, Any]],
    overview: Sequence[ReportPicture],
    viewer: str,
) -> list[tuple[str, str]]:
    """The parts of the page by their ids, in their order."""
    parts = [("summary", "Summary")]
    parts += [("results", "All results")] if overview else []
    parts += [("scene", "Scene in 3D")] if viewer else []
    parts += [(section.key, section.title) for section in report.sections]
    parts += [(section["id"], section["title"]) for section in sections]
    parts += [
        ("clean" if number == 1 else f"clean-{number}", section["title"])
        for number, section in enumerate(clean_sections, start=1)
    ]
    return [*parts, ("definitions", "How the metrics are computed"), ("provenance", "Provenance")]


def _worst(first: FirstScreen, report: Report, pictures: Sequence[ReportPicture]) -> list[ReportPicture]:
    """The picture of the worst that the first headline's attack did, or of the worst clean frame.

    A frame comes in two shapes, the wide one first; nothing comes where there is no picture.
    """
    bags = ("", first.headlines[0].bag) if first.headlines else ()
    drawn = [*pictures, *(each for section in report.sections for each in section.pictures)]
    found = [each for each in drawn if each.is_worst and (bags[-1:] == ("",) or each.bag in bags)]
    alike = [each for each in found if (each.section, each.bag) == (found[0].section, found[0].bag)]
    return alike[:2] if found and found[0].section == FIRST_SCREEN else found[:1]


def _unbroken(text: str) -> Markup:
    """The text in which no line ends between a number and its unit, or within an interval."""
    safe = text if isinstance(text, Markup) else escape(escape_unprintable(text))
    joined = re.sub(r"(?<=\d) (?=(?:%|m|s)(?!\w))", "\u00a0", safe)
    return Markup(re.sub(r"[-−\d.,]+…[-−\d.,]*\d", r'<span class="unbroken">\g<0></span>', joined))


def _anchor(name: str) -> str:
    """The id in the page of a definition or a bag."""
    return "term-" + re.sub(r"[^a-zA-Z0-9]+", "-", name)


def _of(pictures: Sequence[ReportPicture], section: str, bag: str) -> list[ReportPicture]:
    return [picture for picture in pictures if (picture.section, picture.bag) == (section, bag)]


def precision_rows(result: ResultRow) -> list[list[str]]:
    """Average precision by class: class, boxes, then strict, loose and bird's-eye on each kind of cloud."""
    attacked = result.attacked.precisions.ap if result.attacked else {}
    random = result.baselines.get(RANDOM_BEST)
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


def _precision_table(result: ResultRow) -> Table:
    criteria = ("strict 3D", "loose 3D", "strict bird's-eye")
    conditions = ("clean", "attack", "random-best")
    heads = ("class", "boxes", *(f"{each}: {cloud}" for each in criteria for cloud in conditions))
    lines = tuple(tuple(line) for line in precision_rows(result))
    return Table("Average precision (R40) by class, in [0, 1]", heads, lines)
