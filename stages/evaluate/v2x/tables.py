"""The tables of the report's part on V2X."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict

from advpipe.pipeline.misbehaviour.catch import CATCH_MEANINGS, CatchParameters
from advpipe.pipeline.misbehaviour.config import CHECKS, NEED_ROADS, DetectorConfig
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.v2x.detection import ScoredAttack
from advpipe.stages.evaluate.v2x.drive import EvaluatedDrive


def detection_table(attacked: Sequence[EvaluatedDrive]) -> Table:
    """A line for each attack; one for a whole bag before them where no attack is all of it.

    Where nobody lies, as where messages are dropped, there is nothing to find and no figure.
    """
    heads = (
        *("bag", "attack", "messages", "lies", "precision", "recall", "F1", "MCC", "latency s", "caught %"),
        *("baseline precision", "recall", "F1", "MCC", "latency s", "CaTCH published F1"),
    )
    lines = []
    for drive in attacked:
        each = drive.detection
        whole = ScoredAttack("all", each.lies, each.ours, each.baseline, math.nan)
        is_one = any(part.lies == each.lies for part in each.parts)
        for part in each.parts if is_one else (whole, *each.parts):
            figures = (
                *_figures(part.ours),
                formatted_number(100 * part.ours.caught, 0),
                *_figures(part.baseline),
            )
            lines.append(
                (
                    *(
                        drive.name,
                        part.attack,
                        formatted_number(each.messages, 0),
                        formatted_number(part.lies, 0),
                    ),
                    *(figures if part.lies else ("–",) * len(figures)),
                    formatted_number(part.published, 3),
                )
            )
    return Table("Detection of lies", heads, tuple(lines))


def victim_table(drives: Sequence[EvaluatedDrive]) -> Table:
    """What each listener knows, what it is warned of, and what it hears of the honest; the clean drive first.

    What is heard compares the same messages, clean → attacked: those that the attack left alone.
    """
    heads = (
        *("bag", "vehicle", "entries", "false", "at most", "missing", "displaced", "error m"),
        *("alarms", "dangers", "false alarms", "misses", "honest CAMs heard %"),
    )
    lines = []
    for drive in drives:
        for listener, error in drive.errors.items():
            row, warned = error.figures(), drive.warned[listener]
            lines.append(
                (
                    *(
                        drive.name,
                        listener,
                        formatted_number(row.known, 1),
                        formatted_number(row.false_entries, 2),
                    ),
                    *(
                        formatted_number(row.false_entries_max, 0),
                        formatted_number(row.missing, 2),
                        formatted_number(row.displaced, 2),
                    ),
                    formatted_number(row.error_m, 2),
                    *(formatted_number(value, 0) for value in (warned.alarms, warned.dangers)),
                    *(formatted_number(value, 0) for value in (warned.false_alarms, warned.misses)),
                    " → ".join(
                        formatted_number(100 * share, 1) for share in _delivered(drives[0], drive, listener)
                    ),
                )
            )
    return Table("Local Dynamic Map and collision warning", heads, tuple(lines))


def radio_table(drives: Sequence[EvaluatedDrive]) -> Table:
    """The channel that all share."""
    heads = ("bag", "messages sent", "dropped", "delivered %", "busy %", "busy at most %", "delay ms")
    lines = []
    for drive in drives:
        if (row := drive.radio) is not None:
            shares = (row.delivered, row.busy_mean, row.busy_max)
            lines.append(
                (
                    *(drive.name, formatted_number(row.cams, 0), formatted_number(row.dropped, 0)),
                    *(formatted_number(100 * value, 2) for value in shares),
                    formatted_number(1000 * row.delay_s, 2),
                )
            )
    return Table("Radio channel: messages of everybody, attackers included", heads, tuple(lines))


def check_table(config: DetectorConfig, attacked: Sequence[EvaluatedDrive], has_roads: bool) -> Table:
    """Our checks with their thresholds, and how many lies each objects to."""
    lines = []
    for name, check in CHECKS.items():
        is_on = name in config.thresholds and (has_roads or name not in NEED_ROADS)
        above = f"{config.thresholds[name]:.4g} {_unit(check.unit)}".strip() if is_on else "off"
        how = "tuned" if check.is_tuned else "rule"
        hits = sum(drive.detection.objections.get(name, 0) for drive in attacked)
        lines.append(
            (name, check.meaning, above, how, formatted_number(hits, 0) if is_on else "–", check.source)
        )
    heads = ("check", "measures", "objects above", "threshold", "lies it objects to", "after")
    return Table("Our checks", heads, tuple(lines))


def baseline_table(parameters: CatchParameters) -> Table:
    """The baseline's parameters, as tuned and as published."""
    published = asdict(CatchParameters())
    lines = tuple(
        (name, meaning, checks, f"{value:.4g} {unit}", f"{published[name]:.4g} {unit}")
        for name, value in asdict(parameters).items()
        for unit, checks, meaning in (CATCH_MEANINGS[name],)
    )
    return Table("The baseline's parameters", ("parameter", "bounds", "checks", "here", "untuned"), lines)


def _unit(unit: str) -> str:
    """None of a number alone."""
    return "" if unit == "1" else unit


def _delivered(clean: EvaluatedDrive, drive: EvaluatedDrive, listener: str) -> Iterable[float]:
    honest = drive.honest(listener)
    both = (clean, drive) if drive is not clean else (clean,)
    return (one.delivered(listener, honest) for one in both)


def _figures(found: Scores) -> Iterable[str]:
    shares = (found.precision, found.recall, found.f1, found.mcc)
    return (*(formatted_number(value, 3) for value in shares), formatted_number(found.latency_s, 2))
