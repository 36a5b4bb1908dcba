"""The detector's results on the clean clouds, as tables for the page."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.metrics import Interval
from advpipe.stages.evaluate.detection.condition_matches import WHOLE, Precision
from advpipe.stages.evaluate.detection.scoring import CRITERIA
from advpipe.stages.evaluate.detection.strata import STRATA
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import (
    formatted_number,
    interval,
    shown_interval,
)
from advpipe.stages.evaluate.report.section import Table

UNITS = {"range": "", "points": " points", "occlusion": " occluded"}


def class_table(summary: Summary) -> Table:
    """A line a class: boxes, then average precision by every criterion; the mAP is the last line."""
    precisions = {(each.name, each.criterion): each for each in summary.precisions["clean"] if not each.by}
    names = list(dict.fromkeys(name for name, _ in precisions))
    heads = ["class", "boxes"]
    for meaning in CRITERIA.values():
        heads += [f"{meaning.title}, R40", "R11"]
    lines = []
    for name in names:
        line = [name, formatted_number(precisions[name, "strict"].boxes, 0)]
        for criterion in CRITERIA:
            each = precisions[name, criterion]
            line += [
                formatted_number(each.ap_r40, 3) + _in_brackets(each.ap_r40_ci95, summary),
                formatted_number(each.ap_r11, 3),
            ]
        lines.append(tuple(line))
    return Table("By class", tuple(heads), (*lines, _map_line(summary)))


def strata_tables(summary: Summary) -> list[Table]:
    """A table a criterion: a line a class, a column a stratum, each with the number of boxes behind it."""
    tables = []
    for criterion, meaning in CRITERIA.items():
        chosen = {
            (each.name, each.by, each.stratum): each
            for each in summary.precisions["clean"]
            if each.criterion == criterion
        }
        names = list(dict.fromkeys(name for name, _, _ in chosen))
        columns = [("", WHOLE)] + [
            (stratum.by, stratum.name)
            for stratum in STRATA
            if any((name, stratum.by, stratum.name) in chosen for name in names)
        ]
        heads = ("class", *(name.replace("over ", ">") + UNITS.get(by, "") for by, name in columns))
        lines = tuple((name, *(_cell(chosen[(name, *column)]) for column in columns)) for name in names)
        tables.append(Table(f"{meaning.title}, R40", heads, lines))
    return tables


def lead(summary: Summary) -> str:
    """The mAP in a sentence, with the car alone beside it."""
    clean, counts = summary.result.clean, summary.result.counts
    mean, found = clean.means["strict"], clean.precisions
    text = f"mAP {formatted_number(mean.map_r40, 3)}{_in_brackets(mean.map_r40_ci95, summary)}"
    text += f" over {', '.join(counts.classes_in_map)}"
    if ("strict", "car") in found.ap:
        text += f"; car alone {formatted_number(found.ap['strict', 'car'], 3)}"
        text += _in_brackets(found.strict_ci95["car"], summary)
    return text + f". Strict 3D, R40, {counted(counts.frames, 'frame')}."


def distinct_clean(summaries: Sequence[Summary]) -> list[Summary]:
    """One summary for each set of clean frames: adversarial bags of the same frames share their figures."""
    seen: dict[tuple[int, ...], Summary] = {}
    for summary in summaries:
        seen.setdefault(tuple(frame.index for frame in summary.comparison.frames), summary)
    return list(seen.values())


def of_first_detector(summaries: Sequence[Summary]) -> list[Summary]:
    """Those of the detector that was named first."""
    return [each for each in summaries if each.comparison.detector == summaries[0].comparison.detector]


def _map_line(summary: Summary) -> tuple[str, ...]:
    count = len(summary.result.counts.classes_in_map)
    line = ["mAP", f"{count} class{'' if count == 1 else 'es'}"]
    for criterion in CRITERIA:
        mean = summary.result.clean.means[criterion]
        line += [
            formatted_number(mean.map_r40, 3) + _in_brackets(mean.map_r40_ci95, summary),
            formatted_number(mean.map_r11, 3),
        ]
    return tuple(line)


def _cell(each: Precision) -> str:
    return f"{formatted_number(each.ap_r40, 3)} ({each.boxes:,})" if each.boxes else formatted_number(None, 3)


def _in_brackets(bounds: Interval, summary: Summary) -> str:
    shown = shown_interval(bounds, summary.result.counts)
    return f" ({interval(shown, 3)})" if shown else ""
