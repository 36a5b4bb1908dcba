"""The metrics of a comparison: average precision, mAP ratio and its interval, distances, lost objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.metrics.average_precision import RankedMatches
from advpipe.pipeline.metrics.bootstrap import BlockBootstrap
from advpipe.pipeline.results.frame_row import FrameRow
from advpipe.pipeline.results.records import AttackDetectionRecord, DefenceRecord, EffectRecord, SuccessRecord
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.attack_detection import attack_detection_records
from advpipe.stages.evaluate.detection.comparison import Comparison, FrameResult
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches, Precision
from advpipe.stages.evaluate.detection.defended import defence_records
from advpipe.stages.evaluate.detection.effect import effect_records
from advpipe.stages.evaluate.detection.frame_row import frame_row
from advpipe.stages.evaluate.detection.result import result_row
from advpipe.stages.evaluate.detection.scored import Scored
from advpipe.stages.evaluate.detection.scoring import CRITERIA
from advpipe.stages.evaluate.detection.success import success_records

Float64 = npt.NDArray[np.float64]

MIN_BOXES = 50
"""A class with fewer evaluated boxes takes no part in the mAP."""


@dataclass(frozen=True)
class Summary:
    """The metrics of a comparison.

    result: its row of a report. per_frame: its rows of `frames.parquet`.
    min_score: the working point for counts and pictures: the best F1 on the clean clouds.
    precisions: average precisions by condition. curves: by condition, criterion and class, recall and
    precision (G,) from the highest score down. defended: a record for each defence, if any after one
    without. success: a record for each condition, class and range. effects: a record for each condition,
    over all frames and over the attacked ones. attack_detection: a record for each check.
    """

    comparison: Comparison
    result: ResultRow
    per_frame: tuple[FrameRow, ...]
    min_score: float
    precisions: Mapping[str, tuple[Precision, ...]]
    curves: Mapping[tuple[str, str, str], tuple[Float64, Float64]]
    defended: tuple[DefenceRecord, ...] = ()
    success: tuple[SuccessRecord, ...] = ()
    effects: tuple[EffectRecord, ...] = ()
    attack_detection: tuple[AttackDetectionRecord, ...] = ()


def summarise(comparison: Comparison, draws: int, seed: int, warnings: Sequence[str] = ()) -> Summary:
    """The metrics of a comparison, with intervals from so many draws of the bootstrap.

    warnings: the last of its notes. Raises AdvpipeError if no object can be evaluated.
    """
    frames, classes = comparison.frames, comparison.classes
    # Evaluated boxes of each class.
    boxes = {name: sum(frame.clean.matches["strict", name].n_truth for frame in frames) for name in classes}
    if not any(boxes.values()):
        raise AdvpipeError(
            f"{comparison.name}: in {counted(len(frames), 'frame')} no object of a class that the "
            f"detector finds ({', '.join(classes)}) has {MIN_POINTS} points and lies in its range; evaluate "
            "more frames"
        )
    in_map, notes = classes_in_map(boxes)

    def bootstrap_of(chosen: Sequence[FrameResult]) -> BlockBootstrap:
        stamps_ns = [frame.stamp_ns for frame in chosen]
        return BlockBootstrap.of(stamps_ns, draws, named_generator(seed, "evaluate", "bootstrap"))

    bootstrap = bootstrap_of(frames)
    # A baseline that only some frames have, such as those with a moved point, is left out.
    conditions = [
        condition for condition in frames[0].clouds() if all(condition in frame.clouds() for frame in frames)
    ]
    by_condition = {
        condition: ConditionMatches.of(frames, condition, classes, in_map, bootstrap)
        for condition in conditions
    }
    loose = [frame.clean.matches.of_all_classes("loose") for frame in frames]
    min_score = RankedMatches.of(loose).best_f1_score()
    per_frame = tuple(frame_row(frame, min_score) for frame in frames)
    scored = Scored(comparison, by_condition, classes, tuple(in_map), bootstrap, min_score, per_frame)
    result = result_row(scored, boxes, notes, warnings)
    return Summary(
        comparison,
        result,
        per_frame,
        min_score,
        {  # in strata by every criterion on clean clouds, strictly on the others
            condition: tuple(
                evaluated.precisions(
                    frames, condition, tuple(CRITERIA) if condition == "clean" else ("strict",)
                )
            )
            for condition, evaluated in by_condition.items()
        },
        {
            (condition, criterion, name): ranked.precision_recall()
            for condition, evaluated in by_condition.items()
            for (criterion, name), ranked in evaluated.ranked.items()
        },
        tuple(defence_records(scored, result, bootstrap_of)),
        tuple(success_records(scored, result, conditions[1:])),
        tuple(effect_records(scored, result, conditions[1:], bootstrap_of)),
        tuple(attack_detection_records(scored, result)),
    )


def classes_in_map(boxes: Mapping[str, int]) -> tuple[list[str], list[str]]:
    """The classes of the mAP, and notes on the choice."""
    enough = [name for name, count in boxes.items() if count >= MIN_BOXES]
    if enough:
        return enough, []
    some = {name: count for name, count in boxes.items() if count}
    counted = ", ".join(f"{name} {count}" for name, count in some.items())
    few = f"No class has {MIN_BOXES} evaluated boxes"
    return list(some), [f"{few}: mAP over those with any, each with equal weight ({counted})."]
