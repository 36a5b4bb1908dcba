"""A comparison in figures: average precision, mAP ratio and its interval, distances, lost objects."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.metrics.average_precision import R11, RankedMatches
from advpipe.pipeline.metrics.bootstrap import MIN_BLOCK_S, BlockBootstrap, percentile_interval
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.evaluate.detection.arm import Arm, Precision
from advpipe.stages.evaluate.detection.comparison import Comparison, FrameResult
from advpipe.stages.evaluate.detection.frame_row import frame_row
from advpipe.stages.evaluate.detection.scoring import CRITERIA

Row = dict[str, object]
Float64 = npt.NDArray[np.float64]

MIN_BOXES = 50
"""A class with fewer evaluated boxes takes no part in the mAP."""

FEW_BLOCKS = 10

STRATA_CRITERIA = {"clean": tuple(CRITERIA), "adv": ("strict",), "baseline": ("strict",)}
"""By which criteria near and far objects and the like are scored by themselves."""


@dataclass(frozen=True)
class Summary:
    """A comparison in figures.

    row: what `report.json` holds of it. per_frame: its rows of `results.parquet`.
    min_score: the working point for counts and pictures: the best F1 on the clean clouds.
    precisions: average precisions of the clouds `clean`, `adv` and `baseline`, as far as there are any.
    curves: by cloud, criterion and class, recall and precision (G,) from the highest score down.
    """

    comparison: Comparison
    row: Row
    per_frame: tuple[dict[str, int | float | None], ...]
    min_score: float
    precisions: Mapping[str, tuple[Precision, ...]]
    curves: Mapping[tuple[str, str, str], tuple[Float64, Float64]]


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
    arms = {word: Arm.of(frames, word, classes, in_map, bootstrap) for word in frames[0].clouds()}
    min_score = _working_score(frames)
    per_frame = tuple(frame_row(frame, min_score) for frame in frames)
    if bootstrap.n_blocks < 2:
        notes.append(f"The frames fill less than two blocks of {MIN_BLOCK_S:g} s: no confidence interval.")
    elif bootstrap.n_blocks < FEW_BLOCKS:
        notes.append(
            f"Only {bootstrap.n_blocks} blocks of {MIN_BLOCK_S:g} s: the confidence intervals are rough."
        )
    if arms["clean"].mean_ap() == 0 and "adv" in arms:
        notes.append("The mAP on the clean clouds is 0: the mAP ratio is undefined.")

    clean = arms["clean"]
    row: Row = {
        "bag": comparison.name,
        **_attack(comparison.provenance),
        "frames": len(frames),
        "blocks": bootstrap.n_blocks,
        "classes_in_map": list(in_map),
        "working_score": min_score,
        "objects": sum(boxes.values()),
        "objects_found_clean": _sum(per_frame, "found_objects_clean"),
        "false_positives_clean": _sum(per_frame, "false_positives_clean"),
        "points_clean": _sum(per_frame, "points_clean"),
        **{f"boxes_{name}": boxes[name] for name in classes},
        "map_clean": clean.mean_ap(),
        "map_clean_ci95": percentile_interval(clean.map_draws()),
        **_other_means(clean),
        **_precisions(clean, "clean"),
    }
    for word, prefix in (("adv", ""), ("baseline", "baseline_")):
        figures = _figures(arms.get(word, clean), clean, per_frame, word)
        row |= {prefix + name: value if word in arms else None for name, value in figures.items()}
    row |= _difference_to_baseline(arms)
    if hidden := row["objects_below_min_points"]:
        notes.append(f"{hidden} of the objects have fewer than {MIN_POINTS} points left; they still count.")
    row["notes"] = [*notes, *remarks]
    precisions = {
        word: tuple(arm.precisions(frames, word, bootstrap, STRATA_CRITERIA[word]))
        for word, arm in arms.items()
    }
    curves = {
        (word, criterion, name): ranked.precision_recall()
        for word, arm in arms.items()
        for (criterion, name), ranked in arm.ranked.items()
    }
    return Summary(comparison, row, per_frame, min_score, precisions, curves)


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


def _figures(arm: Arm, clean: Arm, per_frame: Sequence[Mapping[str, int | float | None]], word: str) -> Row:
    """What the attacked clouds, or the baseline's, lead to."""
    counts = ("points_added", "points_removed", "points_moved", "objects_below_min_points")
    losses = ("found_objects", "false_positives", "lost_objects", "new_false_positives")
    return {
        "map_adv": arm.mean_ap(),
        "map_ratio_percent": 100 * _ratio(arm.mean_ap(), clean.mean_ap()),
        "map_ratio_ci95": percentile_interval(_ratio_draws(arm, clean)),
        "map_loose_adv": arm.mean_ap("loose"),
        "map_loose_ratio_percent": 100 * _ratio(arm.mean_ap("loose"), clean.mean_ap("loose")),
        "map_bev_adv": arm.mean_ap("bev"),
        "map_bev_loose_adv": arm.mean_ap("bev_loose"),
        **_precisions(arm, "adv"),
        "chamfer_distance_m2": _sum(per_frame, f"chamfer_distance_m2_{word}") / len(per_frame),
        "max_displacement_m": max(_column(per_frame, f"max_displacement_m_{word}"), default=0.0),
        **{name: _sum(per_frame, f"{name}_{word}") for name in counts + losses},
    }


def _difference_to_baseline(arms: Mapping[str, Arm]) -> Row:
    """How many points of mAP ratio the attack costs beyond the same budget spent at random."""
    if "baseline" not in arms:
        return {"map_ratio_minus_baseline": None, "map_ratio_minus_baseline_ci95": None}
    clean, adversarial, baseline = arms["clean"], arms["adv"], arms["baseline"]
    draws = _ratio_draws(adversarial, clean) - _ratio_draws(baseline, clean)
    return {
        "map_ratio_minus_baseline": 100 * _ratio(adversarial.mean_ap() - baseline.mean_ap(), clean.mean_ap()),
        "map_ratio_minus_baseline_ci95": percentile_interval(draws),
    }


def _other_means(clean: Arm) -> Row:
    """The mAP on the clean clouds beside strict 3D R40: R11, and everything by the other criteria."""
    row: Row = {"map_r11_clean": clean.mean_ap("strict", R11)}
    for criterion in (word for word in CRITERIA if word != "strict"):
        row |= {
            f"map_{criterion}_clean": clean.mean_ap(criterion),
            f"map_{criterion}_clean_ci95": percentile_interval(clean.map_draws(criterion)),
            f"map_{criterion}_r11_clean": clean.mean_ap(criterion, R11),
        }
    return row


def _precisions(arm: Arm, word: str) -> Row:
    """Average precision of each class: strict 3D without a further word, then loose, then bird's-eye."""
    row: Row = {}
    for (criterion, name), ranked in arm.ranked.items():
        key = f"ap_{name}_{word}" if criterion == "strict" else f"ap_{criterion}_{name}_{word}"
        row[key] = ranked.average_precision()
        if criterion == "strict":
            row[f"{key}_ci95"] = percentile_interval(arm.draws[criterion, name])
    return row


def _attack(provenance: Mapping[str, str]) -> Row:
    """Attack, recipe, and its budget: the parameter that the attack names, else its first."""
    parameters = json.loads(provenance.get("parameters", "{}"))
    parameter = provenance.get("budget", next(iter(parameters), None))
    return {
        "attack": provenance.get("attack", "none" if not provenance else "unknown"),
        "recipe": provenance.get("recipe"),
        "parameter": parameter,
        "value": parameters.get(parameter),
        "parameters": parameters,
    }


def _working_score(frames: Sequence[FrameResult]) -> float:
    loose = [m for frame in frames for (word, _), m in frame.clean.matches.items() if word == "loose"]
    return RankedMatches.of(loose).best_f1_score()


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


def _ratio_draws(arm: Arm, clean: Arm) -> Float64:
    """The mAP ratio in percent (draws,); NaN where the clean mAP is 0."""
    whole = np.where(clean.map_draws() > 0, clean.map_draws(), np.nan)
    return 100 * arm.map_draws() / whole


def _column(per_frame: Sequence[Mapping[str, int | float | None]], name: str) -> list[int | float]:
    return [value for row in per_frame if (value := row[name]) is not None]


def _sum(per_frame: Sequence[Mapping[str, int | float | None]], name: str) -> int | float:
    return sum(_column(per_frame, name))
