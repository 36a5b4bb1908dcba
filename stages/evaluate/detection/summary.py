"""A comparison in figures: average precision, mAP ratio and its interval, distances, lost objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.metrics.average_precision import RankedMatches
from advpipe.pipeline.metrics.bootstrap import MIN_BLOCK_S, BlockBootstrap, percentile_interval
from advpipe.stages.evaluate.detection.arm import Arm, Precision
from advpipe.stages.evaluate.detection.baseline import (
    BASELINES,
    baseline_title,
    baseline_words,
)
from advpipe.stages.evaluate.detection.comparison import Comparison, FrameResult
from advpipe.stages.evaluate.detection.defended import defended_rows
from advpipe.stages.evaluate.detection.figures import (
    Row,
    attack_figures,
    clean_means,
    difference,
    precisions,
    recounted_figures,
    total,
)
from advpipe.stages.evaluate.detection.frame_row import frame_row
from advpipe.stages.evaluate.detection.scoring import CRITERIA
from advpipe.stages.evaluate.detection.success import success_rows

Float64 = npt.NDArray[np.float64]

MIN_BOXES = 50
"""A class with fewer evaluated boxes takes no part in the mAP."""

FEW_BLOCKS = 10


@dataclass(frozen=True)
class Summary:
    """A comparison in figures.

    row: what `report.json` holds of it. per_frame: its rows of `frames.parquet`.
    min_score: the working point for counts and pictures: the best F1 on the clean clouds.
    precisions: average precisions of the clean, the adversarial and the baselines' clouds, as far as there
    are any. curves: by cloud, criterion and class, recall and precision (G,) from the highest score down.
    defended: one row a defence. success: one row a cloud, class and range.
    """

    comparison: Comparison
    row: Row
    per_frame: tuple[dict[str, int | float | None], ...]
    min_score: float
    precisions: Mapping[str, tuple[Precision, ...]]
    curves: Mapping[tuple[str, str, str], tuple[Float64, Float64]]
    defended: tuple[Row, ...] = ()
    success: tuple[Row, ...] = ()


def summarise(
    comparison: Comparison, classes: tuple[str, ...], draws: int, seed: int, remarks: Sequence[str] = ()
) -> Summary:
    """The figures of a comparison for a detector of these classes.

    remarks: what the reader must know besides. Raises AdvpipeError if not one object can be evaluated.
    """
    frames = comparison.frames
    boxes = count_boxes(frames, classes)
    if not any(boxes.values()):
        raise AdvpipeError(
            f"{comparison.name}: in {len(frames)} frames no object of a class that the detector finds "
            f"({', '.join(classes)}) has {MIN_POINTS} points and lies in its range; evaluate more frames"
        )
    in_map, notes = classes_in_map(boxes)
    stamps_ns = [frame.stamp_ns for frame in frames]
    bootstrap = BlockBootstrap.of(stamps_ns, draws, named_generator(seed, "evaluate", "bootstrap"))
    # A baseline that only some frames have, such as those with a moved point, is none of the whole.
    words = [word for word in frames[0].clouds() if all(word in frame.clouds() for frame in frames)]
    arms = {word: Arm.of(frames, word, classes, in_map, bootstrap) for word in words}
    min_score = _working_score(frames)
    per_frame = tuple(frame_row(frame, min_score) for frame in frames)
    notes += _notes_on_blocks(bootstrap.n_blocks)
    if arms["clean"].mean_ap() == 0 and "adv" in arms:
        notes.append("The mAP on the clean clouds is 0: the mAP ratio is undefined.")

    clean = arms["clean"]
    row: Row = {
        "bag": comparison.name,
        "detector": comparison.detector,
        **_attack(comparison),
        "frames": len(frames),
        "blocks": bootstrap.n_blocks,
        "classes_in_map": list(in_map),
        "working_score": min_score,
        "objects": sum(boxes.values()),
        "objects_found_clean": total(per_frame, "found_objects_clean"),
        "false_positives_clean": total(per_frame, "false_positives_clean"),
        "points_clean": total(per_frame, "points_clean"),
        **{f"boxes_{name}": boxes[name] for name in classes},
        "map_clean": clean.mean_ap(),
        "map_clean_ci95": percentile_interval(clean.map_draws()),
        **clean_means(clean),
        **precisions(clean, "clean"),
        **_attacked(arms, frames, per_frame),
    }
    if hidden := row["objects_below_min_points"]:
        notes.append(f"{hidden} of the objects have fewer than {MIN_POINTS} points left; they still count.")
    row["notes"] = [*notes, *_notes_on_baselines(row), *remarks]
    criteria = {"clean": tuple(CRITERIA)}
    precisions_of = {
        word: tuple(arm.precisions(frames, word, bootstrap, criteria.get(word, ("strict",))))
        for word, arm in arms.items()
    }
    curves = {
        (word, criterion, name): ranked.precision_recall()
        for word, arm in arms.items()
        for (criterion, name), ranked in arm.ranked.items()
    }
    return Summary(
        comparison,
        row,
        per_frame,
        min_score,
        precisions_of,
        curves,
        tuple(defended_rows(comparison, row, arms, classes, in_map, bootstrap)),
        tuple(success_rows(comparison, row, words[1:], classes, min_score, bootstrap)),
    )


def count_boxes(frames: Sequence[FrameResult], classes: Sequence[str]) -> dict[str, int]:
    """How many evaluated boxes each class has."""
    return {name: sum(frame.clean.matches["strict", name].n_truth for frame in frames) for name in classes}


def classes_in_map(boxes: Mapping[str, int]) -> tuple[list[str], list[str]]:
    """The classes of the mAP, and what the reader must know about the choice."""
    enough = [name for name, count in boxes.items() if count >= MIN_BOXES]
    if enough:
        return enough, []
    some = [name for name, count in boxes.items() if count]
    return some, [f"No class has {MIN_BOXES} evaluated boxes: mAP over those with any ({', '.join(some)})."]


def _attacked(
    arms: Mapping[str, Arm],
    frames: Sequence[FrameResult],
    per_frame: tuple[dict[str, int | float | None], ...],
) -> Row:
    """The figures of the attack (no prefix) and of every baseline (its word before them); None without one.

    The attack `beats_random` if the 95 % interval of its paired difference to every baseline is below 0;
    None where there is no baseline or no interval.
    """
    clean, row = arms["clean"], Row()
    baselines = [word for word in baseline_words() if word in arms]
    shown = {"adv": "", **{word: f"{word}_" for word in dict.fromkeys((next(iter(BASELINES)), *baselines))}}
    for word, prefix in shown.items():
        there = word in arms
        figures = attack_figures(arms.get(word, clean), clean, frames, per_frame, word if there else "clean")
        row |= {prefix + name: value if there else None for name, value in figures.items()}
    recounted = recounted_figures(
        arms.get("adv", clean), clean, frames, per_frame, "adv" if "adv" in arms else "clean"
    )
    row |= {name: value if "adv" in arms else None for name, value in recounted.items()}
    row |= {"map_ratio_minus_baseline": None, "map_ratio_minus_baseline_ci95": None, "baselines": baselines}
    beaten: list[bool | None] = []
    for word in baselines:
        points, bounds = difference(arms, word)
        beaten.append(None if bounds is None else bounds[1] < 0)
        row |= {
            f"map_ratio_minus_{word}": points,
            f"map_ratio_minus_{word}_ci95": bounds,
            f"beats_{word}": beaten[-1],
        }
    row["beats_random"] = None if not beaten or None in beaten else all(beaten)
    return row


def _notes_on_blocks(n_blocks: int) -> list[str]:
    if n_blocks < 2:
        return [f"The frames fill less than two blocks of {MIN_BLOCK_S:g} s: no confidence interval."]
    if n_blocks < FEW_BLOCKS:
        return [f"Only {n_blocks} blocks of {MIN_BLOCK_S:g} s: the confidence intervals are rough."]
    return []


def _notes_on_baselines(row: Row) -> list[str]:
    """Whether the baselines had fewer tries than the attack, and which of them it does not beat."""
    words, tries, looks = row["baselines"], row["baseline_tries"], row["looks"]
    notes = []
    if isinstance(tries, int) and isinstance(looks, int) and 0 < tries < looks:
        notes = [f"The random baselines are the best of {tries}, the attack is the best of {looks} tries."]
    if row["beats_random"] is not False or not isinstance(words, list):
        return notes
    unbeaten = [baseline_title(word) for word in words if not row[f"beats_{word}"]]
    return [*notes, f"Does not beat the same budget spent {'; '.join(unbeaten)}."]


def _attack(comparison: Comparison) -> Row:
    """Attack, recipe, and its budget: the parameter that the attack names, else its first."""
    provenance = comparison.provenance
    parameters = provenance.parameters
    parameter = provenance.get("budget", next(iter(parameters), None))
    return {
        "attack": provenance.get("attack", "none" if not provenance else "unknown"),
        "recipe": provenance.get("recipe"),
        "parameter": parameter,
        "value": parameters.get(parameter) if parameter else None,
        "parameters": parameters,
        "attacked_against": provenance.get("detector"),
        "is_white_box": comparison.is_white_box,
        "looks": provenance.said.looks,
        "baseline_tries": comparison.baseline_tries,
    }


def _working_score(frames: Sequence[FrameResult]) -> float:
    loose = [m for frame in frames for (word, _), m in frame.clean.matches.items() if word == "loose"]
    return RankedMatches.of(loose).best_f1_score()
