"""The report's part on localisation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.localisation.monitor import MONITOR_PROBABILITY, WINDOW_FIXES, nis_threshold
from advpipe.pipeline.replay.recorded_filter import default_victim, vehicles_with_filter
from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.localisation.metrics import (
    LOST_M,
    localisation_record,
    was_attacked,
)
from advpipe.stages.evaluate.localisation.plot import draw_localisation
from advpipe.stages.evaluate.localisation.track import LocalisationTrack, attacked_fixes_ns, read_track
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection, Table

FORMULAS = (
    Formula(
        "localisation_error",
        "horizontal distance of the on-board estimate from the true position, from the first attacked fix to "
        "the last; lateral: its component across the direction of travel",
        ("clean_*_m", "adv_*_m"),
        title="Error of the position estimate",
    ),
    Formula(
        "ate",
        "absolute trajectory error: root mean square of estimate minus truth, height included, without "
        "alignment; in report.json over the {of_what}",
        ("ate_clean_m", "ate_m"),
        title="Absolute trajectory error (ATE)",
    ),
    Formula(
        "innovation_test",
        "a fix fails where residual' covariance^-1 residual is above chi-square's "
        f"{100 * MONITOR_PROBABILITY:g} % quantile with 3 degrees of freedom",
        title="Innovation test",
    ),
    Formula(
        "windowed_innovation_test",
        f"at a fix the sum of that value over it and the {WINDOW_FIXES - 1} before it is above chi-square's "
        f"{100 * MONITOR_PROBABILITY:g} % quantile with {3 * WINDOW_FIXES} degrees of freedom; share of the "
        "attacked fixes at which it fails, of the clean bag's, and the delay until it first does",
        ("window_detection_rate", "window_false_alarm_rate", "window_delay_s"),
        title="Windowed innovation test",
    ),
    Formula(
        "detected",
        "share of the attacked fixes that fail the test; stealth: share that pass it; delay: from the first "
        "attacked fix to the first that fails; false alarms: share of the clean bag's fixes that fail; echo: "
        "share of genuine fixes after the first attacked one that fail",
        ("detection_rate", "stealth_rate", "delay_s", "false_alarm_rate", "echo_rate"),
        title="Attacked fixes detected",
    ),
    Formula(
        "success",
        f"share of the time from the first attacked fix to the last in which the estimate is more than "
        f"{LOST_M:g} m off",
        ("success_rate",),
        title="Success of a GPS attack",
    ),
)


def localisation_sections(
    clean: Path, adversarial: Sequence[Path], seed: int = 0, window: Window = WHOLE_DRIVE
) -> tuple[ReportSection, ...]:
    """One section on all adversarial bags in which fixes were attacked; none where there are none.

    window: the part of the drive that is evaluated; filters run from the beginning of the drive to its end.
    `seed` is not used. Raises AdvpipeError for bags from which a filter cannot be run again.
    """
    rows: list[LocalisationRecord] = []
    pictures: list[ReportPicture] = []
    of_what = "whole drive" if window == WHOLE_DRIVE else "window"
    for row, picture in _compare(clean, adversarial, window, of_what):
        rows.append(row)
        pictures.append(picture)
    if not rows:
        return ()
    return (
        ReportSection(
            key="localisation",
            title="Localisation under GPS attacks",
            lead="The vehicles' own filters run again on the fixes of each bag. The threshold of the "
            f"innovation test is {nis_threshold():.2f}, that of the windowed test over {WINDOW_FIXES} fixes "
            f"{nis_threshold(WINDOW_FIXES):.2f}.",
            tables=(_error_table(rows), _detection_table(rows)),
            pictures=tuple(pictures),
            records=tuple(rows),
            formulas=tuple(
                each._replace(meaning=each.meaning.replace("{of_what}", of_what)) for each in FORMULAS
            ),
            terminal=(_overview(rows),),
        ),
    )


def _compare(
    clean: Path, adversarial: Sequence[Path], window: Window, of_what: str
) -> Iterator[tuple[LocalisationRecord, ReportPicture]]:
    reader, until_ns = BagReader(clean), window.last_ns
    tracks: dict[str, LocalisationTrack] = {}
    attacks = [
        (bag, *each) for bag in adversarial for each in _attacked_vehicles(reader, BagReader(bag), until_ns)
    ]
    for bag, vehicle, fixes_ns in track(attacks, "localisation", len(attacks)) if attacks else ():
        if vehicle not in tracks:
            tracks[vehicle] = read_track(reader, vehicle, until_ns)
        before, after = tracks[vehicle], read_track(BagReader(bag), vehicle, until_ns)
        if not np.array_equal(before.times_ns, after.times_ns):
            raise AdvpipeError(
                f"{bag} holds estimates of {vehicle} at other times than {clean}; attack the whole drive, "
                "without frames"
            )
        # By the times of their estimates, so that a fix and its estimate are both in the window or neither.
        attacked_ns = before.times_ns[was_attacked(before, fixes_ns) & window.holds(before.times_ns)]
        before, after = before.within(window), after.within(window)
        if not len(before.times_ns):
            continue
        name = bag_name(bag)
        row = localisation_record(name, vehicle, before, after, attacked_ns)
        figure = draw_localisation(before, after, was_attacked(before, attacked_ns), of_what)
        caption = f"{name}: trajectory of {vehicle}, its localisation error and its innovations over time"
        picture = picture_of(SECTION, name, f"{name}-{vehicle}-localisation.png", caption, figure)
        yield row, replace(picture, is_worst=True)


def _attacked_vehicles(
    clean: BagReader, adversarial: BagReader, last_ns: int | None
) -> Iterator[tuple[str, npt.NDArray[np.int64]]]:
    """The vehicles whose fixes were attacked, with the times of these fixes.

    With `last_ns`, also the victims of attacks that begin later, without any times.
    """
    recorded = adversarial.provenance.fields.attacks if last_ns is not None else ()
    known = sorted({*vehicles_with_filter(clean)} & {*vehicles_with_filter(adversarial)})
    victims = {one.victim or default_victim(known) for one in recorded if one.family == "gnss"}
    for vehicle in known:
        attacked_ns = attacked_fixes_ns(clean, adversarial, vehicle, last_ns)
        if len(attacked_ns) or vehicle in victims:
            yield vehicle, attacked_ns


def _error_table(rows: Sequence[LocalisationRecord]) -> Table:
    """A line of the errors while attacked and, where that is not all of the time, one of all errors."""
    lines = []
    for row in rows:
        spans = {
            "attacked": (row.clean, row.adversarial),
            "all": (row.clean_all, row.adversarial_all),
        }
        if row.adversarial == row.adversarial_all:
            spans.pop("attacked")
        about = (row.bag, row.vehicle, f"{row.attacked} of {row.fixes}", str(row.lost))
        for number, (span, (clean, attacked)) in enumerate(spans.items()):
            lines.append(
                (
                    *(about if number == 0 else ("", "", "", "")),
                    span,
                    _pair(clean.mean_m, attacked.mean_m),
                    _pair(clean.rmse_m, attacked.rmse_m),
                    _pair(clean.max_m, attacked.max_m),
                    _pair(clean.lateral_mean_m, attacked.lateral_mean_m),
                    _pair(clean.lateral_max_m, attacked.lateral_max_m),
                    _pair(clean.ate_m, attacked.ate_m),
                )
            )
    heads = (
        *("bag", "vehicle", "fixes attacked", "fixes lost", "time", "mean m", "RMSE m", "max m"),
        *("lateral, mean m", "lateral, max m", "ATE m"),
    )
    note = "Attacked: from the first attacked fix to the last."
    is_part = any(line[4] == "attacked" for line in lines)
    return Table("Error of the position estimate (clean → attacked)", heads, tuple(lines), note * is_part)


def _detection_table(rows: Sequence[LocalisationRecord]) -> Table:
    heads = (
        *("bag", "vehicle", "detected %", "delay s", "stealth %", "false alarms %", "echo %"),
        *("window: detected %", "window: delay s", "window: false alarms %", "success %"),
    )
    lines = [
        (
            row.bag,
            row.vehicle,
            formatted_number(100 * row.detection_rate, 1),
            formatted_number(row.delay_s, 1),
            formatted_number(100 * row.stealth_rate, 1),
            formatted_number(100 * row.false_alarm_rate, 2),
            formatted_number(100 * row.echo_rate, 1),
            formatted_number(100 * row.window_detection_rate, 1),
            formatted_number(row.window_delay_s, 1),
            formatted_number(100 * row.window_false_alarm_rate, 2),
            formatted_number(100 * row.success_rate, 1),
        )
        for row in rows
    ]
    return Table("The innovation tests", heads, tuple(lines))


def _overview(rows: Sequence[LocalisationRecord]) -> Table:
    """The main columns of both tables, for a terminal."""
    heads = (
        "GNSS attack",
        "fixes attacked",
        "mean error m",
        "max error m",
        "detected %",
        "by window %",
        "success %",
    )
    lines = tuple(
        (
            f"{row.bag}: {row.vehicle}",
            f"{row.attacked} of {row.fixes}",
            _pair(row.clean.mean_m, row.adversarial.mean_m),
            _pair(row.clean.max_m, row.adversarial.max_m),
            formatted_number(100 * row.detection_rate, 1),
            formatted_number(100 * row.window_detection_rate, 1),
            formatted_number(100 * row.success_rate, 1),
        )
        for row in rows
    )
    title = f"Localisation: error while attacked, clean → attacked; success: more than {LOST_M:g} m off"
    return Table(title, heads, lines)


def _pair(clean: float, attacked: float) -> str:
    return f"{formatted_number(clean, 2)} → {formatted_number(attacked, 2)}"
