"""The tables of the report's part on V2X."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict

from advpipe.pipeline.misbehaviour.catch import BOUNDED_CATCH, CATCH_MEANINGS, F1_CATCH, PUBLISHED_CATCH
from advpipe.pipeline.misbehaviour.config import CHECKS, NEED_ROADS, DetectorConfig
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.v2x.detection import ScoredAttack
from advpipe.stages.evaluate.v2x.drive import EvaluatedDrive
from advpipe.stages.evaluate.v2x.ldm_error import LdmError

DETECTION_NOTE = (
    "Messages: received by all instrumented vehicles in the bag. A false message is one that an attack made, "
    "changed or delayed so that it mattered. Latency: from an attacker's first false message to the first "
    "flagged one. Attackers detected: those with any flagged message. Innocent flagged: of the messages of "
    "stations that do not attack; attackers' true messages, of which a flood has many, are honest, too, and "
    "lower the precision when they are flagged. The baseline is built from CaTCH's "
    "checks; the last column holds what is published for CaTCH on other data."
)
VICTIM_NOTE = (
    "Entries, false, missing and displaced are mean numbers of entries in the vehicle's Local Dynamic Map "
    "over time: false ones of stations that do not exist, missing ones of stations within 150 m, displaced "
    "ones more than 3 m off; error: mean distance of entries from their stations. Alarms: collision warnings "
    "fed by the map; dangers: the same warnings fed by true positions. Honest CAMs received: share of the "
    "CAMs sent within 300 m that the attack did not touch, in the clean drive → in the attacked one."
)

COMPARISON_NOTE = (
    "advpipe: our detector; catch: CaTCH's checks as VeReMi NextGen has them, tuned with the same bound on "
    "false positives as ours; catch-f1: tuned for F1 alone; catch-published: with the parameters that "
    "NextGen published for its urban simulation of 2 a.m. Your own detectors stand beside them. AUC: area "
    "under the ROC curve."
)

ATTACKED_NOTE = " Attacked: from the first attacked message sent to the last."


def detection_table(attacked: Sequence[EvaluatedDrive]) -> Table:
    """A line for each attack; one for a whole bag before them where no attack is all of it.

    Without false messages, as where messages are dropped, there is nothing to find and no metric.
    """
    heads = (
        *("attack", "messages", "false ones", "precision", "recall", "F1", "MCC", "latency s"),
        *("attackers detected %", "innocent flagged %", "baseline: precision", "recall", "F1", "MCC"),
        *("latency s", "baseline: innocent flagged %"),
        "F1 published for CaTCH",
    )
    lines = []
    for drive, part in _scored_attacks(attacked):
        cells = (
            *_score_cells(part.ours),
            formatted_number(100 * part.ours.caught, 0),
            formatted_number(100 * part.ours.innocent_false_positive_rate, 2),
            *_score_cells(part.baseline),
            formatted_number(100 * part.baseline.innocent_false_positive_rate, 2),
        )
        lines.append(
            (
                _title(drive, part),
                formatted_number(drive.detection.messages, 0),
                formatted_number(part.false_messages, 0),
                *(cells if part.false_messages else (NOTHING,) * len(cells)),
                formatted_number(part.published, 3),
            )
        )
    return Table("Detection of false messages", heads, tuple(lines), DETECTION_NOTE)


def detection_overview(attacked: Sequence[EvaluatedDrive]) -> Table:
    """The main columns of `detection_table`, for a terminal."""
    heads = ("V2X attack", "received", "false", "recall", "F1", "latency s", "CaTCH F1")
    lines = []
    for drive, part in _scored_attacks(attacked):
        ours = part.ours
        cells = (
            *(formatted_number(value, 3) for value in (ours.recall, ours.f1)),
            formatted_number(ours.latency_s, 2),
            formatted_number(part.baseline.f1, 3),
        )
        lines.append(
            (
                _title(drive, part),
                formatted_number(drive.detection.messages, 0),
                formatted_number(part.false_messages, 0),
                *(cells if part.false_messages else (NOTHING,) * len(cells)),
            )
        )
    title = "V2X detection: messages received, false ones, misbehaviour detector, baseline"
    return Table(title, heads, tuple(lines))


def _title(drive: EvaluatedDrive, part: ScoredAttack) -> str:
    return part.attack if part.attack.startswith(drive.name) else f"{drive.name}: {part.attack}"


def _scored_attacks(attacked: Sequence[EvaluatedDrive]) -> Iterator[tuple[EvaluatedDrive, ScoredAttack]]:
    """Each attack of each bag; the whole bag before them where no single attack made all false messages."""
    for drive in attacked:
        each = drive.detection
        if each.parts and all(part.false_messages != each.false_messages for part in each.parts):
            yield (
                drive,
                ScoredAttack(
                    attack="all",
                    false_messages=each.false_messages,
                    detectors=each.detectors,
                    published=math.nan,
                ),
            )
        for part in each.parts:
            yield drive, part


def victim_table(drives: Sequence[EvaluatedDrive]) -> Table:
    """The map, the warnings and the honest messages received of each vehicle; the clean drive first.

    Where messages are attacked in a part of the drive, two more lines have the map in this part: attacked,
    and in the clean drive.
    """
    heads = (
        *("bag", "vehicle", "time", "entries", "false", "false, maximum", "missing", "displaced", "error m"),
        *("alarms", "dangers", "false alarms", "missed dangers", "honest CAMs received %"),
    )
    clean, *_ = drives
    lines = []
    for drive in drives:
        for listener, error in drive.errors.items():
            warned = drive.warned[listener]
            counts = (warned.alarms, warned.dangers, warned.false_alarms, warned.misses)
            lines.append(
                (
                    *(drive.name, listener, "all", *_map_cells(error)),
                    *(formatted_number(value, 0) for value in counts),
                    _honest_received(clean, drive, listener),
                )
            )
            if (span := drive.attacked_ns) is None:
                continue
            alone = error.between(*span)
            if 0 < len(alone.time_ns) < len(error.time_ns):
                lines.append(("", "", "attacked", *_map_cells(alone), *(NOTHING,) * 5))
                if listener in clean.errors:
                    before = clean.errors[listener].between(*span)
                    lines.append(("", "", "  the same, clean", *_map_cells(before), *(NOTHING,) * 5))
    is_part = any(line[2] == "attacked" for line in lines)
    return Table(
        "Local Dynamic Map and collision warning", heads, tuple(lines), VICTIM_NOTE + ATTACKED_NOTE * is_part
    )


def _map_cells(error: LdmError) -> tuple[str, ...]:
    row = error.metrics()
    return (
        formatted_number(row.known, 1),
        formatted_number(row.false_entries, 2),
        formatted_number(row.false_entries_max, 0),
        formatted_number(row.missing, 2),
        formatted_number(row.displaced, 2),
        formatted_number(row.error_m, 2),
    )


def victim_overview(drives: Sequence[EvaluatedDrive]) -> Table:
    """The main columns of `victim_table`, for a terminal."""
    heads = ("LDM", "false", "missing", "displaced", "error m", "false alarms", "missed", "received %")
    lines = []
    for drive in drives:
        for listener, error in drive.errors.items():
            row, warned = error.metrics(), drive.warned[listener]
            lines.append(
                (
                    f"{drive.name}: {listener}",
                    *(formatted_number(v, 2) for v in (row.false_entries, row.missing, row.displaced)),
                    formatted_number(row.error_m, 2),
                    *(formatted_number(value, 0) for value in (warned.false_alarms, warned.misses)),
                    _honest_received(drives[0], drive, listener),
                )
            )
    title = (
        "Local Dynamic Map: mean numbers of false, missing and displaced entries; collision warnings: "
        "false alarms, missed dangers; honest CAMs received, clean → attacked"
    )
    return Table(title, heads, tuple(lines))


def radio_table(drives: Sequence[EvaluatedDrive]) -> Table:
    """The radio channel of each drive."""
    heads = (
        *("bag", "messages sent", "not sent", "delivered %", "channel busy %", "channel busy, maximum %"),
        "mean delay ms",
    )
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
    return Table("Radio channel: messages of all stations, including attackers", heads, tuple(lines))


def check_table(config: DetectorConfig, attacked: Sequence[EvaluatedDrive], has_roads: bool) -> Table:
    """The detector's checks with their thresholds, and how many false messages each flags."""
    lines = []
    for name, check in CHECKS.items():
        is_on = name in config.thresholds and (has_roads or name not in NEED_ROADS)
        threshold = f"{config.thresholds[name]:.4g} {_unit(check.unit)}".strip() if is_on else "off"
        set_by = "tuning" if check.is_tuned else "rule"
        flagged = sum(drive.detection.flagged_by_check.get(name, 0) for drive in attacked)
        flagged_cell = formatted_number(flagged, 0) if is_on else NOTHING
        lines.append((name, check.meaning, threshold, set_by, flagged_cell, check.source))
    heads = ("check", "measures", "flags above", "threshold set by", "false messages flagged", "source")
    return Table("Checks of the misbehaviour detector", heads, tuple(lines), is_detail=True)


def comparison_table(attacked: Sequence[EvaluatedDrive]) -> Table:
    """F1 and AUC of every detector on each attack."""
    names = list(attacked[0].detection.detectors) if attacked else []
    heads = ("attack", *(head for name in names for head in (f"{name}: F1", "AUC", "flagged honest %")))
    lines = []
    for drive, part in _scored_attacks(attacked):
        cells = []
        for name in names:
            found = part.detectors[name]
            cells += [
                *(formatted_number(found.scores.f1, 3), formatted_number(found.roc.auc, 3)),
                formatted_number(100 * found.scores.false_positive_rate, 2),
            ]
        lines.append((_title(drive, part), *(cells if part.false_messages else (NOTHING,) * len(cells))))
    return Table("Misbehaviour detectors compared", heads, tuple(lines), COMPARISON_NOTE)


def baseline_table() -> Table:
    """The baseline's parameters, as tuned and as published."""
    published = {f"published, {name}": each for name, each in PUBLISHED_CATCH.items()}
    columns = {"catch": BOUNDED_CATCH, "catch-f1": F1_CATCH, **published}
    values = {name: asdict(parameters) for name, parameters in columns.items()}
    lines = tuple(
        (key, meaning, checks, _unit(unit), *(f"{each[key]:.4g}" for each in values.values()))
        for key, (unit, checks, meaning) in CATCH_MEANINGS.items()
    )
    heads = ("parameter", "meaning", "checks", "unit", *values)
    return Table("Parameters of the baseline (CaTCH's checks)", heads, lines, is_detail=True)


def _unit(unit: str) -> str:
    """A unit as tables show it: nothing for a dimensionless number."""
    return "" if unit == "1" else unit.replace("m/s2", "m/s²")


def _honest_received(clean: EvaluatedDrive, drive: EvaluatedDrive, listener: str) -> str:
    """The share of untouched CAMs that a vehicle receives, in percent, clean → attacked."""
    honest = drive.honest(listener)
    both = (clean, drive) if drive is not clean else (clean,)
    return " → ".join(formatted_number(100 * one.delivered(listener, honest), 1) for one in both)


def _score_cells(found: Scores) -> Iterable[str]:
    shares = (found.precision, found.recall, found.f1, found.mcc)
    return (*(formatted_number(value, 3) for value in shares), formatted_number(found.latency_s, 2))
