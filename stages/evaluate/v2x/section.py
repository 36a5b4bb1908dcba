"""The report's part on V2X: misbehaviour detection, effects on Local Dynamic Maps and warnings, the radio."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
from advpipe.pipeline.misbehaviour.config import NEED_ROADS, DetectorConfig
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector
from advpipe.pipeline.results.v2x import AttackScores, DetectorRecord, ScoreMetrics, V2xRecord
from advpipe.stages.evaluate.detection.comparison import bag_name
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.pictures import picture_of
from advpipe.stages.evaluate.report.section import SECTION, Formula, ReportPicture, ReportSection
from advpipe.stages.evaluate.v2x.drive import EvaluatedDrive, read_drive
from advpipe.stages.evaluate.v2x.picture import draw_detection, draw_errors, draw_maps
from advpipe.stages.evaluate.v2x.roc_picture import draw_roc
from advpipe.stages.evaluate.v2x.tables import (
    baseline_table,
    check_table,
    comparison_table,
    detection_overview,
    detection_table,
    radio_table,
    victim_overview,
    victim_table,
)
from advpipe.stages.evaluate.v2x.verdict_table import VERDICTS_FILE, VerdictTable

FORMULAS = (
    Formula(
        "false message",
        "a received message that an attack changed, added or delayed so that it mattered, or an attacker's "
        "message that is not a CAM; all others are honest. Other messages that are not CAMs are dropped by "
        "the decoder and not counted. The metrics of one attack leave out false messages of other attacks in "
        "the same bag",
        ("messages", "false_messages", "undecoded"),
        title="False message",
    ),
    Formula(
        "F1, MCC",
        "2 TP / (2 TP + FP + FN); Matthews' correlation coefficient; each reception of a message by a "
        "vehicle counts once",
        ("precision", "recall", "f1", "mcc", "false_positive_rate", "baseline_f1"),
        title="F1 and MCC of misbehaviour detection",
    ),
    Formula(
        "ROC, AUC",
        "recall against the false-positive rate, as the threshold on a detector's score of a message falls; "
        "the area under the whole curve is the probability that a false message has a higher score than an "
        "honest one. Each score is the worst of a message's checks: of ours, the largest ratio of a "
        "statistic to its threshold; of CaTCH, 1 minus the smallest factor. What a message is compared with "
        "stays as it is at the detector's own threshold",
        ("auc", "roc_false_positive_rates", "roc_recalls"),
        title="ROC curve and the area under it (AUC)",
    ),
    Formula(
        "innocent flagged",
        "share of the messages of stations that do not attack that are flagged; an attacker's true messages "
        "are honest ones, too, but flagging them harms nobody who is honest",
        ("innocent_false_positive_rate", "baseline_innocent_false_positive_rate"),
        title="False positives of innocent stations",
    ),
    Formula(
        "latency",
        "time from the first false message of an attacker that a vehicle receives to the first one that is "
        "flagged, the mean over detected attackers; detected attackers: share of the attackers with any "
        "flagged message",
        ("latency_s", "caught"),
        title="Detection latency",
    ),
    Formula(
        "false, missing, displaced",
        "per Local Dynamic Map, the mean over time: entries of stations that do not exist; stations within "
        "150 m without an entry; entries, extrapolated with their speed, more than 3 m from their station",
        ("ldm_false_entries", "ldm_missing", "ldm_displaced", "ldm_error_m"),
        title="False, missing and displaced entries of the Local Dynamic Map",
    ),
    Formula(
        "warning",
        "a forward-collision warning: time to collision below 2.5 s with anything ahead in the vehicle's "
        "path. Alarms come from the Local Dynamic Map, dangers from the true positions of all stations; an "
        "alarm without a danger within 1 s is false, a danger without an alarm is missed",
        ("warning_alarms", "warning_dangers", "warning_false_alarms", "warning_misses"),
        title="Collision warning",
    ),
    Formula(
        "delivered",
        "share of pairs of message and receiver within 300 m, over all messages and stations. Honest CAMs "
        "received: share of the CAMs sent within 300 m of the vehicle that no attack touched, the same CAMs "
        "in the clean drive and in the attacked one. Channel busy ratio: in windows of 100 ms",
        ("radio_delivered", "honest_delivered", "honest_delivered_clean", "radio_busy_mean"),
        title="Messages delivered",
    ),
    Formula(
        "CaTCH published",
        "F1 in VeReMi NextGen's documentation, urban traffic of low density: other data, for orientation; "
        "the value for constant speeds is for zero speed only",
        title="Published values of CaTCH",
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
    detectors: Mapping[str, MisbehaviourDetector] = MISBEHAVIOUR_DETECTORS,
    window: Window = WHOLE_DRIVE,
) -> tuple[ReportSection, ...]:
    """One section on all adversarial bags in which messages were attacked; none where there are none.

    window: as `read_drive` takes it. `seed` serves no draw here. Raises AdvpipeError for bags whose V2X or
    labels cannot be read.
    """
    del seed
    labelled = [bag for bag in adversarial if has_v2x(bag) and has_labels(bag)]
    touched = [bag for bag in labelled if read_labels(bag)]
    if not touched or not has_v2x(clean):
        return ()
    named = [(clean, "clean"), *((bag, bag_name(bag)) for bag in touched)]
    with VerdictTable() as table:
        first, *others = _drives(named, detectors, window, table)
    found = replace(section(first, others), files={VERDICTS_FILE: table.content})
    untouched = [bag_name(bag) for bag in labelled if bag not in touched]
    notes = (
        [f"{', '.join(untouched)}: the attacks touched no message, so there is nothing to evaluate."]
        if untouched
        else []
    )
    if window != WHOLE_DRIVE:
        notes.append("No metrics of the radio channel: bags record them for whole drives only.")
    return (replace(found, notes=(*found.notes, *notes)),)


def _drives(
    named: Sequence[tuple[Path, str]],
    detectors: Mapping[str, MisbehaviourDetector],
    window: Window,
    table: VerdictTable,
) -> Iterator[EvaluatedDrive]:
    """The evaluated bags; their verdicts go into the table, as those of all bags would fill the memory."""
    for bag, name in track(named, "V2X of each bag", len(named)):
        drive = read_drive(bag, name, detectors, window)
        table.add(name, drive.detection.verdicts)
        yield replace(drive, detection=replace(drive.detection, verdicts=()))


def section(clean: EvaluatedDrive, attacked: Sequence[EvaluatedDrive]) -> ReportSection:
    """Tables, pictures and records of drives that have been read."""
    drives = (clean, *attacked)
    scored = [drive for drive in attacked if drive.detection.parts]
    return ReportSection(
        key="v2x",
        title="V2X: misbehaviour detection and the effects of false messages",
        lead=_lead(clean, attacked),
        tables=(
            *((detection_table(scored), comparison_table(scored)) if scored else ()),
            victim_table(drives),
            radio_table(drives),
            check_table(DetectorConfig(), attacked, any(drive.roads for drive in drives)),
            baseline_table(),
        ),
        pictures=tuple(_pictures(clean, attacked)),
        records=tuple(_record(clean, drive, listener) for drive in drives for listener in drive.errors),
        notes=tuple(_notes(drives)),
        formulas=FORMULAS,
        terminal=(*((detection_overview(scored),) if scored else ()), victim_overview(drives)),
    )


def _lead(clean: EvaluatedDrive, attacked: Sequence[EvaluatedDrive]) -> str:
    """Mean F1 of both detectors, and their false positives on the clean drive, where there are messages."""
    false = [drive.detection for drive in attacked if drive.detection.false_messages]
    sentences = ["No bag has a received false message here, so F1 is undefined."]
    if false:
        ours, baseline = _mean([each.ours.f1 for each in false]), _mean([each.baseline.f1 for each in false])
        sentences = [
            f"Mean F1 over {len(false)} {'bag' if len(false) == 1 else 'bags'} with false messages: "
            f"{formatted_number(ours, 3)}; baseline built from CaTCH's checks: "
            f"{formatted_number(baseline, 3)}."
        ]
    honest = clean.detection
    if honest.messages:
        sentences.append(
            f"Of the {honest.messages:,} messages received in the clean drive, all honest, "
            f"{formatted_number(100 * honest.ours.false_positive_rate, 2)} % are flagged; by the baseline "
            f"{formatted_number(100 * honest.baseline.false_positive_rate, 2)} %."
        )
    else:
        sentences.append("No message was received in the clean drive here.")
    return " ".join([*sentences, f"Both were tuned on {'; '.join(tuned.DRIVES)}."])


def _notes(drives: Sequence[EvaluatedDrive]) -> list[str]:
    notes = []
    off = [drive.name for drive in drives if drive.roads is None]
    if off:
        notes.append(
            f"{', '.join(off)}: the bag does not hold its roads ({LANES.name}), so the checks "
            f"{' and '.join(NEED_ROADS)} and the baseline's position check are off."
        )
    if spared := [drive.name for drive in drives if drive.attack and not drive.detection.parts]:
        notes.append(
            f"{', '.join(spared)}: no CAM is attacked, so there is nothing to detect among CAMs; the parts "
            "on collective perception and on warnings have the effects of attacks on CPMs and DENMs."
        )
    notes += [f"{drive.name}: {sentence}" for drive in drives for sentence in drive.missing_data]
    undecoded = sum(drive.detection.undecoded for drive in drives)
    if undecoded:
        notes.append(
            f"{undecoded:,} received messages are not CAMs and were not sent by an attack: they are not "
            "scored."
        )
    return notes


def _pictures(clean: EvaluatedDrive, attacked: Sequence[EvaluatedDrive]) -> list[ReportPicture]:
    has_published = any(part.published == part.published for d in attacked for part in d.detection.parts)
    caption = f"F1 of each attack{'; the published values are of other data' if has_published else ''}"
    scored = [d.detection for d in attacked if d.detection.parts]
    figures = [("", "v2x-detection.png", caption, draw_detection(scored))] if scored else []
    if any(part.detectors and part.false_messages for d in attacked for part in d.detection.parts):
        caption = "ROC curve of each attack and detector; a dot marks the share that the detector flags"
        figures.append(("", "v2x-roc.png", caption, draw_roc(scored)))
    for drive in attacked:
        listener = drive.most_affected_listener
        if listener is None or not drive.moments[listener] or not drive.detection.parts:
            continue
        before, during = drive.maps_around_attack(listener)
        title = f"{drive.name}: Local Dynamic Map of {listener}"
        caption = f"{title} before the attack, and when it holds most false entries nearby"
        figures.append((drive.name, f"{drive.name}-ldm.png", caption, draw_maps(before, during, drive.roads)))
        if listener in clean.errors:
            errors = draw_errors(clean.errors[listener], drive.errors[listener], title)
            figures.append((drive.name, f"{drive.name}-ldm-error.png", f"{title} over time", errors))
    drawn = [picture_of(SECTION, bag, name, caption, figure) for bag, name, caption, figure in figures]
    return [replace(each, is_worst=each.file_name.endswith("-ldm.png")) for each in drawn]


def _record(clean: EvaluatedDrive, drive: EvaluatedDrive, listener: str) -> V2xRecord:
    honest, each = drive.honest(listener), drive.detection
    attacked, before = (
        one.errors[listener].between(*drive.attacked_ns).metrics()
        if drive.attacked_ns and listener in one.errors
        else None
        for one in (drive, clean)
    )
    return V2xRecord(
        bag=drive.name,
        vehicle=listener,
        attack=drive.attack,
        false_messages=each.false_messages,
        messages=each.messages,
        undecoded=each.undecoded,
        has_roads=drive.roads is not None,
        attacks=tuple(
            AttackScores(
                one.attack,
                one.false_messages,
                _score_metrics(one.ours),
                _score_metrics(one.baseline),
                tuple(
                    DetectorRecord(
                        name,
                        _score_metrics(result.scores),
                        result.roc.auc,
                        result.roc.false_positive_rates,
                        result.roc.recalls,
                    )
                    for name, result in one.detectors.items()
                ),
            )
            for one in each.parts
        ),
        honest_delivered=drive.delivered(listener, honest),
        honest_delivered_clean=clean.delivered(listener, honest),
        ours=_score_metrics(each.ours),
        baseline=_score_metrics(each.baseline),
        ldm=drive.errors[listener].metrics(),
        ldm_attacked=attacked,
        ldm_attacked_clean=before,
        warning=drive.warned[listener],
        radio=drive.radio,
    )


def _score_metrics(found: Scores) -> ScoreMetrics:
    return ScoreMetrics(
        precision=found.precision,
        recall=found.recall,
        f1=found.f1,
        mcc=found.mcc,
        latency_s=found.latency_s,
        caught=found.caught,
        false_positive_rate=found.false_positive_rate,
        innocent_false_positive_rate=found.innocent_false_positive_rate,
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if value == value]
    return float(np.mean(known)) if known else float("nan")
