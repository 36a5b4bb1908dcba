"""What a reader of a sweep's tables must know to interpret their values."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.campaigns.sweep.budgets import AXES
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.ingredients import lines_of, measured
from advpipe.pipeline.campaigns.sweep.variants import split_recipe
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.report.wording import ABOUT_BASELINES, OLDER_BASELINES, OVERLAPS, WHITE_BOX

SAME_DATA = (
    "The paper's figures are those of its own detector and its own recording of Town06; ours are of the "
    "detector and the drive named below, and a lower ratio than the paper's says nothing of which attack is "
    "the stronger. Figures of the paper have no interval, and no random baseline stands beside them."
)

NOT_SURE = (
    "Among the ingredients, recipe robust is the earlier one, which expected 1 cm of jitter and nothing "
    "else. It is sure to bring something for attach alone: for detach it leaves as much after jitter or "
    "rounding as best does, for perturb about as much as random-best, and both are weaker without either."
)


def sweep_caveats(cells: Sequence[Cell]) -> list[str]:
    """Sentences for the page, the terminal and report.json."""
    return [
        SAME_DATA,
        *([ABOUT_BASELINES] if any(RANDOM_BEST in cell.row.baselines for cell in cells) else []),
        *([OLDER_BASELINES] if any(_is_older(cell) for cell in cells) else []),
        *_random_best_measured(cells),
        *_lost(cells),
        *_held_still(cells),
        *([NOT_SURE] if measured(cells) else []),
        WHITE_BOX,
    ]


def _random_best_measured(cells: Sequence[Cell]) -> list[str]:
    """How strong random-best is, on the drive that the ingredients of `best` were measured on."""
    sentences = []
    for attack, about in measured(cells).items():
        lines = lines_of(about)
        if {"recipe best", "recipe random-best"} <= lines.keys():
            best, random = (lines[f"recipe {each}"] for each in ("best", "random-best"))
            budget = f"{AXES[attack].title.partition(', ')[2]} {best['budget']:g}"
            ratios = (formatted_number(each["map_ratio_plain_percent"], 1) for each in (random, best))
            sentences.append(f"{attack} ({budget}) {' % against '.join(ratios)} %")
    if not sentences:
        return []
    return [
        "On another drive, the one on which the detector was validated, recipe random-best leaves, against "
        f"recipe best: {'; '.join(sentences)} of the clean mAP."
    ]


def _lost(cells: Sequence[Cell]) -> list[str]:
    scores = sorted({formatted_number(cell.row.counts.working_score, 2) for cell in cells})
    if not scores:
        return []
    return [
        "Lost objects are found on the clean cloud and missed on the attacked one at loose overlap, with a "
        f"score of at least {' or '.join(scores)} (the best F1 on the clean clouds of a cell's frames). "
        f"{_STRICTLY_LOST if all(cell.listed for cell in cells) else _NOT_KEPT} Overlaps: {OVERLAPS}."
    ]


_STRICTLY_LOST = (
    "How many are lost at strict overlap, where most mAP ratios are taken, stands beside, by range."
)
_NOT_KEPT = "Not all cells hold how many are lost at strict overlap: older versions kept no such record."


def _held_still(cells: Sequence[Cell]) -> list[str]:
    """How much of its budget recipe `paper` uses where it moves points."""
    sentences = []
    for cell in cells:
        weight, moved_m = _parameter(cell, "weight"), cell.attacked.rms_displacement_m
        allowed_cm = _parameter(cell, "eps_cm")
        if _recipe(cell) == "paper" and weight and allowed_cm is not None:
            sentences.append(
                f"{cell.name}: the weight λ = {weight:g} of the Chamfer distance, beside steps of equal "
                f"length for each point, holds the points to {1000 * moved_m:.1f} mm (RMS) of the "
                f"{10 * allowed_cm:g} mm allowed, so these are figures of hardly any perturbation. The paper "
                "names a λ and gives it no value."
            )
    return sentences


def _is_older(cell: Cell) -> bool:
    return bool(cell.row.baselines) and RANDOM_BEST not in cell.row.baselines


def _recipe(cell: Cell) -> str:
    return split_recipe(cell.recipe)[0]


def _parameter(cell: Cell, name: str) -> float | None:
    value = cell.row.attack.parameters.get(name)
    return float(value) if isinstance(value, int | float) else None
