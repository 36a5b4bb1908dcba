"""The report's part on attack detection: how well checks tell attacked clouds from clean ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from advpipe.pipeline.attack_detection.temporal import MAX_GAP_S, MIN_RUN
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.records import AttackDetectionRecord
from advpipe.stages.evaluate.detection.attack_checks import CALIBRATION_CLOUDS, MIN_SCORE
from advpipe.stages.evaluate.detection.attack_detection import FALSE_POSITIVE_RATE
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.section import Formula, ReportSection, Table

FORMULAS = (
    Formula(
        "attack_detection",
        "a check gives each cloud a score; detected are attacked clouds whose score exceeds a threshold. The "
        "threshold of each half of the frames is calibrated on the clean clouds of the other half, such that "
        f"a further clean cloud exceeds it with a probability of {100 * FALSE_POSITIVE_RATE:g} % at most, or "
        "of 1 / (clouds + 1) where they are too few for that; false alarms are clean clouds that exceed it",
        ("true_positive_percent", "false_positive_percent", "expected_false_positive_percent"),
        title="Attacks detected and false alarms",
    ),
    Formula(
        "auc",
        "area under the ROC curve: how often the score of an attacked cloud is above that of a clean one, "
        "ties counting half; 0.5 is chance",
        ("auc",),
        title="Area under the ROC curve (AUC)",
    ),
    Formula(
        "points_flagged",
        "of the points that the attack moved or added, the share that a check flags; of points of clean "
        "clouds, the share that it flags falsely. Removed points cannot be flagged",
        ("points_true_positive_percent", "points_false_positive_percent"),
        title="Attacked points flagged",
    ),
    Formula(
        "boxes_flagged",
        f"of detections with a score of at least {MIN_SCORE:g} that the clean cloud lacks, the share above "
        "the threshold; and of the detections in clean clouds",
        ("new_detections_true_positive_percent", "detections_false_positive_percent"),
        title="New detections flagged",
    ),
    Formula(
        "boxes_called_fake",
        "the verdict of a published detector (CARLO, Shadow-Catcher) on each box, by limits that it fits to "
        "clean clouds and to spoofed objects of the defender's own: of detections that the clean cloud "
        "lacks, and of those in clean clouds. It is about spoofing: an attack that moves, removes or hides "
        "objects need not bring new ones",
        ("new_detections_called_fake_percent", "detections_called_fake_percent"),
        title="New detections called fake",
    ),
)

HEADS = (
    *("attack", "check", "detected %", "false alarms %", "AUC", "points flagged %", "clean points flagged %"),
    *("new boxes flagged %", "clean boxes flagged %", "new boxes called fake %", "clean boxes called fake %"),
)
SHORT_HEADS = ("check", "detected %", "false alarms %", "AUC", "points flagged %")


def attack_detection_sections(summaries: Mapping[str, Summary]) -> Iterator[ReportSection]:
    """One section on the attacks, by their titles; none where no check ran."""
    records = [(title, each) for title, summary in summaries.items() for each in summary.attack_detection]
    notes = tuple(_notes(summaries, [each for _, each in records]))
    if not (records or notes):
        return
    yield ReportSection(
        "attack_detection",
        "Attack detection",
        "Whether a defender who knows the sensor and clean clouds of the drive would notice each attack. "
        f"The checks learn the sensor from {CALIBRATION_CLOUDS} clean clouds; no attack but the recipe "
        "stealthy takes them into account. A high rate of detection says that the attack is no threat to a "
        "vehicle that runs the check, and nothing of one that does not.",
        (Table("Each attack under each check", HEADS, tuple(_lines(records))),) if records else (),
        records=tuple(each for _, each in records),
        notes=notes,
        formulas=FORMULAS,
        terminal=(
            Table(
                "Attack detection: clouds above a threshold of clean ones, attacked points flagged",
                SHORT_HEADS,
                tuple(
                    (f"{title}: {each.check}", *_cells(each)[: len(SHORT_HEADS) - 1])
                    for title, each in records
                ),
            ),
        )
        if records
        else (),
    )


def _lines(records: list[tuple[str, AttackDetectionRecord]]) -> Iterator[tuple[str, ...]]:
    before = ""
    for title, each in records:
        yield ("" if title == before else title, each.check, *_cells(each))
        before = title


def _cells(each: AttackDetectionRecord) -> tuple[str, ...]:
    return (
        formatted_number(each.true_positive_percent, 1),
        formatted_number(each.false_positive_percent, 1),
        formatted_number(each.auc, 3),
        formatted_number(each.points_true_positive_percent, 1),
        formatted_number(each.points_false_positive_percent, 2),
        formatted_number(each.new_detections_true_positive_percent, 1),
        formatted_number(each.detections_false_positive_percent, 1),
        formatted_number(each.new_detections_called_fake_percent, 1),
        formatted_number(each.detections_called_fake_percent, 1),
    )


def _notes(summaries: Mapping[str, Summary], records: list[AttackDetectionRecord]) -> Iterator[str]:
    """How many clouds the thresholds were calibrated on, and which checks did not run."""
    fewest = min(records, key=lambda each: each.calibration_frames, default=None)
    if fewest is None:
        pass
    elif not fewest.calibration_frames:
        yield "No threshold: it takes two clean clouds at least."
    else:
        yield (
            f"Thresholds are calibrated on {counted(fewest.calibration_frames, 'clean cloud')} of the drive, "
            f"so that up to {formatted_number(fewest.expected_false_positive_percent, 1)} % of further ones "
            "are false alarms."
        )
    not_run = {
        name: why
        for summary in summaries.values()
        for frame in summary.comparison.frames[:1]
        for name, why in frame.checks_not_run.items()
    }
    ran = {each.check for each in records}
    not_run |= {
        name: f"it takes {MIN_RUN} consecutive attacked clouds, at most {MAX_GAP_S:g} s apart, such as of "
        "`--frames 100:140`"
        for summary in summaries.values()
        for name in summary.comparison.sequence_checks
        if name not in ran
    }
    for name, why in not_run.items():
        yield f"Check {name} did not run: {why}."
