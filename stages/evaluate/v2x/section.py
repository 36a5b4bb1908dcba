"""The report's part on V2X: lies found out, what the victim's map and warning make of them, the radio."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.labels.messages import has_labels, read_labels
from advpipe.pipeline.messages.topics import LANES, V2X_SENT, V2X_STATIONS
from advpipe.pipeline.misbehaviour import tuned
from advpipe.pipeline.misbehaviour.catch import TUNED_CATCH, CatchParameters
from advpipe.pipeline.misbehaviour.config import NEED_ROADS, DetectorConfig
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.pipeline.results.v2x import AttackScores, ScoreFigures, V2xRecord
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.section import SECTION, ReportPicture, ReportSection
from advpipe.stages.evaluate.v2x.drive import EvaluatedDrive, read_drive
from advpipe.stages.evaluate.v2x.picture import draw_detection, draw_errors, draw_maps
from advpipe.stages.evaluate.v2x.tables import (
    baseline_table,
    check_table,
    detection_table,
    radio_table,
    victim_table,
)

FORMULAS = (
    (
        "lie",
        "a received message that an attack changed, added or delayed so that it mattered, or an attacker's "
        "that is no CAM; others are honest. One that is no CAM and nobody's lie is dropped by the decoder "
        "and counts for nothing. Figures of one attack leave out the lies of others in its bag",
    ),
    ("F1, MCC", "2 TP / (2 TP + FP + FN); Matthews' correlation; a message is one reception of one listener"),
    (
        "latency",
        "from the first lie of a liar that a listener hears to its first lie that is flagged, the mean",
    ),
    (
        "ghost, missing, displaced",
        "entries of stations that are not there; stations within 150 m without an entry; entries, carried "
        "on with their speed, more than 3 m from their station",
    ),
    (
        "warning",
        "time to collision below 2.5 s with what is ahead in the own path; false alarms and misses against "
        "the same rule fed by the truth of all stations, within 1 s",
    ),
    (
        "delivered",
        "share of pairs of message and receiver within 300 m, of all messages and stations; honest CAMs "
        "heard: by the vehicle itself, of those that the attack left alone, the same ones in the clean drive "
        "and in the attacked one; busy: channel busy ratio of 100 ms windows",
    ),
    (
        "CaTCH published",
        "F1 in VeReMi NextGen's documentation, urban traffic of low density: other data, for orientation; "
        "that of constant speeds is of zero speed only",
    ),
)


def has_v2x(bag: Path) -> bool:
    """Whether a bag holds V2X that can be evaluated."""
    reader = BagReader(bag)
    return {V2X_STATIONS.name, V2X_SENT.name} <= reader.topics.keys() or bool(receiving_vehicles(reader))


def v2x_sections(
    clean: Path,
    adversarial: Sequence[Path],
    seed: int = 0,
    config: DetectorConfig | None = None,
    parameters: CatchParameters = TUNED_CATCH,
    window: Window = WHOLE_DRIVE,
) -> tuple[ReportSection, ...]:
    """One section on all adversarial bags in which messages were attacked; none where there are none.

    config, parameters: of our detector and of the baseline. window: as `read_drive` takes it. `seed` serves
    no draw here. Raises AdvpipeError for bags whose V2X or labels cannot be read.
    """
    del seed
    labelled = [bag for bag in adversarial if has_v2x(bag) and has_labels(bag)]
    lied = [bag for bag in labelled if read_labels(bag)]
    if not lied or not has_v2x(clean):
        return ()
    config = config or DetectorConfig()
    named = [(clean, "clean"), *((bag, bag_name(bag)) for bag in lied)]
    first, *others = (
        read_drive(bag, name, config, parameters, window)
        for bag, name in track(named, "V2X of each bag", len(named))
    )
    found = section(first, others, config, parameters)
    idle = [bag_name(bag) for bag in labelled if bag not in lied]
    notes = (
        [f"{', '.join(idle)}: the attacks touched no message, so there is nothing to say."] if idle else []
    )
    if window != WHOLE_DRIVE:
        notes.append("The channel's figures are left out: bags tell them of whole drives alone.")
    return (replace(found, notes=(*found.notes, *notes)),)


def section(
    clean: EvaluatedDrive,
    attacked: Sequence[EvaluatedDrive],
    config: DetectorConfig,
    parameters: CatchParameters = TUNED_CATCH,
) -> ReportSection:
    """Tables, pictures and records of drives that have been read."""
    told = [drive.detection for drive in attacked if drive.detection.lies]
    ours, theirs = [each.ours.f1 for each in told], [each.baseline.f1 for each in told]
    rate = clean.detection.ours.false_positive_rate
    lead = (
        f"Mean F1 over {len(told)} {'bag' if len(told) == 1 else 'bags'} with lies "
        f"{formatted_number(_mean(ours), 3)}, of the baseline built from CaTCH's checks "
        f"{formatted_number(_mean(theirs), 3)}; of {clean.detection.messages:,} honest messages of the "
        f"clean drive {formatted_number(100 * rate, 2)} % are flagged, by the baseline "
        f"{formatted_number(100 * clean.detection.baseline.false_positive_rate, 2)} %. "
        f"What both were tuned on: {'; '.join(tuned.DRIVES)}."
    )
    drives = (clean, *attacked)
    return ReportSection(
        key="v2x",
        title="V2X: lies told, believed and found out",
        lead=lead,
        tables=(
            detection_table(attacked),
            victim_table(drives),
            radio_table(drives),
            check_table(config, attacked, any(drive.roads for drive in drives)),
            baseline_table(parameters),
        ),
        pictures=tuple(_pictures(clean, attacked)),
        records=tuple(_record(clean, drive, listener) for drive in drives for listener in drive.errors),
        notes=tuple(_notes(drives)),
        formulas=FORMULAS,
    )


def _notes(drives: Sequence[EvaluatedDrive]) -> list[str]:
    notes = []
    off = [drive.name for drive in drives if drive.roads is None]
    if off:
        notes.append(
            f"{', '.join(off)}: the bag does not tell its roads ({LANES.name}), so the checks "
            f"{' and '.join(NEED_ROADS)} are off there, as is the baseline's position check."
        )
    notes += [f"{drive.name}: {sentence}" for drive in drives for sentence in drive.untold]
    undecoded = sum(drive.detection.undecoded for drive in drives)
    if undecoded:
        notes.append(f"{undecoded:,} messages received are no CAM, and nobody's lie: they are not scored.")
    return notes


def _pictures(clean: EvaluatedDrive, attacked: Sequence[EvaluatedDrive]) -> list[ReportPicture]:
    caption = "F1 of each attack; the published figures are of other data"
    figures = [("", "v2x-detection.png", caption, draw_detection([d.detection for d in attacked]))]
    for drive in attacked:
        listener = drive.most_fooled
        if listener is None or not drive.moments[listener]:
            continue
        before, during = drive.telling(listener)
        words = f"{drive.name}: the map of {listener}"
        figures.append((drive.name, f"{drive.name}-ldm.png", words, draw_maps(before, during, drive.roads)))
        if listener in clean.errors:
            errors = draw_errors(clean.errors[listener], drive.errors[listener], words)
            figures.append((drive.name, f"{drive.name}-ldm-error.png", f"{words} over time", errors))
    return [
        ReportPicture(SECTION, bag, name, caption, to_png(figure)) for bag, name, caption, figure in figures
    ]


def _record(clean: EvaluatedDrive, drive: EvaluatedDrive, listener: str) -> V2xRecord:
    honest, each = drive.honest(listener), drive.detection
    return V2xRecord(
        bag=drive.name,
        vehicle=listener,
        attack=each.attack,
        false_messages=each.lies,
        messages=each.messages,
        undecoded=each.undecoded,
        has_roads=drive.roads is not None,
        attacks=tuple(
            AttackScores(one.attack, one.lies, _figures(one.ours), _figures(one.baseline))
            for one in each.parts
        ),
        honest_delivered=drive.delivered(listener, honest),
        honest_delivered_clean=clean.delivered(listener, honest),
        ours=_figures(each.ours),
        baseline=_figures(each.baseline),
        ldm=drive.errors[listener].figures(),
        warning=drive.warned[listener],
        radio=drive.radio,
    )


def _figures(found: Scores) -> ScoreFigures:
    return ScoreFigures(
        precision=found.precision,
        recall=found.recall,
        f1=found.f1,
        mcc=found.mcc,
        latency_s=found.latency_s,
        caught=found.caught,
        false_positive_rate=found.false_positive_rate,
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if value == value]
    return float(np.mean(known)) if known else float("nan")
