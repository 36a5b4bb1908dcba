"""The report's part on localisation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.replay.recorded_filter import default_victim, vehicles_with_filter
from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.localisation.figures import (
    GATE_PROBABILITY,
    LOST_M,
    gate,
    localisation_record,
    was_attacked,
)
from advpipe.stages.evaluate.localisation.plot import draw_localisation
from advpipe.stages.evaluate.localisation.track import LocalisationTrack, attacked_fixes_ns, read_track
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.section import SECTION, ReportPicture, ReportSection, Table

FORMULAS = (
    (
        "localisation_error",
        "horizontal distance of the on-board estimate from the true place, from the first attacked fix to "
        "the last; sideways: its part across the direction of travel",
    ),
    (
        "ate",
        "root mean square of estimate minus truth over the {of_what}, height included, without alignment",
    ),
    (
        "innovation_test",
        "a fix fails where residual' covariance^-1 residual is above chi-square's "
        f"{100 * GATE_PROBABILITY:g} % quantile with 3 degrees of freedom",
    ),
    (
        "detected",
        "share of the attacked fixes that fail the test; stealth: that pass it; delay: from the first "
        "attacked fix to the first that fails; false alarms: share of the clean bag's fixes that fail; echo: "
        "of genuine fixes after the first attacked one",
    ),
    ("success", f"share of the attacked span in which the estimate is more than {LOST_M:g} m off"),
)


def localisation_sections(
    clean: Path, adversarial: Sequence[Path], seed: int = 0, window: Window = WHOLE_DRIVE
) -> tuple[ReportSection, ...]:
    """One section on all adversarial bags in which fixes were attacked; none where there are none.

    window: its figures count; filters run from the beginning of the drive to its end. `seed` serves no
    draw here. Raises AdvpipeError for bags from which a filter cannot be run again.
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
            f"innovation test is {gate():.2f}.",
            tables=(_error_table(rows, of_what), _detection_table(rows)),
            pictures=tuple(pictures),
            records=tuple(rows),
            formulas=tuple((name, words.replace("{of_what}", of_what)) for name, words in FORMULAS),
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
                f"{bag} holds other estimates of {vehicle} than {clean}; attack the whole drive, without "
                "frames"
            )
        # Told by their estimates, so that a fix and its estimate lie on the same side of the window's ends.
        attacked_ns = before.times_ns[was_attacked(before, fixes_ns) & window.holds(before.times_ns)]
        before, after = before.within(window), after.within(window)
        if not len(before.times_ns):
            continue
        name = bag_name(bag)
        row = localisation_record(name, vehicle, before, after, attacked_ns)
        figure = draw_localisation(before, after, was_attacked(before, attacked_ns), of_what)
        caption = f"{name}: {vehicle}, its way on the map, its error and its innovations over time"
        yield row, ReportPicture(SECTION, name, f"{name}-{vehicle}-localisation.png", caption, to_png(figure))


def _attacked_vehicles(
    clean: BagReader, adversarial: BagReader, last_ns: int | None
) -> Iterator[tuple[str, npt.NDArray[np.int64]]]:
    """Those whose fixes were attacked, with the times of these.

    With `last_ns`, also the victims of attacks that begin later, without any.
    """
    told = adversarial.provenance.fields.attacks if last_ns is not None else ()
    known = sorted({*vehicles_with_filter(clean)} & {*vehicles_with_filter(adversarial)})
    victims = {one.victim or default_victim(known) for one in told if one.family == "gnss"}
    for vehicle in known:
        attacked_ns = attacked_fixes_ns(clean, adversarial, vehicle, last_ns)
        if len(attacked_ns) or vehicle in victims:
            yield vehicle, attacked_ns


def _error_table(rows: Sequence[LocalisationRecord], of_what: str) -> Table:
    heads = ("bag", "vehicle", "fixes attacked", "lost", "mean m", "RMSE m", "max m")
    lines = []
    for row in rows:
        pairs = zip(
            (row.clean.mean_m, row.clean.rmse_m, row.clean.max_m),
            (row.adversarial.mean_m, row.adversarial.rmse_m, row.adversarial.max_m),
            strict=True,
        )
        sideways = _pair(row.clean.lateral_mean_m, row.adversarial.lateral_mean_m)
        lines.append(
            (
                row.bag,
                row.vehicle,
                f"{row.attacked} of {row.fixes}",
                str(row.lost),
                *(_pair(*pair) for pair in pairs),
                sideways,
                _pair(row.clean.lateral_max_m, row.adversarial.lateral_max_m),
                _pair(row.ate_clean_m, row.ate_m),
            )
        )
    title = "Error of the estimate while attacked (clean → attacked)"
    ate = f"ATE of the {of_what.removeprefix('whole ')} m"
    return Table(title, (*heads, "sideways, mean m", "sideways, max m", ate), tuple(lines))


def _detection_table(rows: Sequence[LocalisationRecord]) -> Table:
    heads = ("bag", "vehicle", "detected %", "delay s", "stealth %", "false alarms %", "echo %", "success %")
    lines = [
        (
            row.bag,
            row.vehicle,
            formatted_number(100 * row.detection_rate, 1),
            formatted_number(row.delay_s, 1),
            formatted_number(100 * row.stealth_rate, 1),
            formatted_number(100 * row.false_alarm_rate, 2),
            formatted_number(100 * row.echo_rate, 1),
            formatted_number(100 * row.success_rate, 1),
        )
        for row in rows
    ]
    return Table("The innovation test", heads, tuple(lines))


def _pair(clean: float, attacked: float) -> str:
    return f"{formatted_number(clean, 2)} → {formatted_number(attacked, 2)}"
