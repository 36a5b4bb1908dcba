"""Tables at loose overlap: how much of an attack hides objects, and how much displaces their boxes."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.campaigns.sweep.budgets import BUDGETS
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.draws import paired_interval
from advpipe.pipeline.campaigns.sweep.tables import RANDOM
from advpipe.stages.evaluate.report.numbers import NOTHING, formatted_number, interval
from advpipe.stages.evaluate.report.section import Table


def loose_table(cells: Sequence[Cell]) -> Table:
    """The mAP ratio at strict and at loose overlap: how much of an attack hides, and how much misplaces."""
    heads = (
        "cell",
        "strict: ratio %",
        "loose: ratio %",
        f"{RANDOM}, loose: ratio %",
        *("Δ to it, points", "95 %"),
        "lost, loose",
        "of found, loose",
        "score at least",
    )
    lines = [
        (
            cell.name,
            formatted_number(cell.attacked.map_ratio_percent, 2),
            formatted_number(cell.attacked.map_loose_ratio_percent, 2),
            formatted_number(random.map_loose_ratio_percent, 2)
            if (random := cell.strongest_random)
            else NOTHING,
            *_loose_difference(cell),
            formatted_number(sum(cell.lost_objects), 0),
            formatted_number(sum(cell.found_objects), 0),
            formatted_number(cell.row.counts.working_score, 2),
        )
        for cell in cells
    ]
    return Table("At loose overlap: hidden rather than misplaced", heads, tuple(lines))


def hidden_table(cells: Sequence[Cell]) -> Table:
    """What recipe `hide` leaves at loose overlap, paired with what `best` leaves."""
    heads = ("budget", "best, loose: ratio %", "hide, loose: ratio %", "hide minus best, points", "95 %")
    found = {(cell.recipe, cell.budget): cell for cell in cells}
    lines = []
    for budget in BUDGETS:
        best, hide = (found.get((recipe, budget.name)) for recipe in ("best", "hide"))
        if best and hide:
            ratios = [each.attacked.map_loose_ratio_percent for each in (best, hide)]
            draws = [each.other_draws.get("loose", ()) for each in (best, hide)]
            is_paired = (best.frames, best.settings.seed) == (hide.frames, hide.settings.seed)
            lines.append(
                (
                    budget.name,
                    *(formatted_number(ratio, 2) for ratio in ratios),
                    formatted_number(ratios[1] - ratios[0], 2),
                    interval(paired_interval(*draws) if is_paired else None),
                )
            )
    return Table("Hidden at loose overlap: recipe hide against best", heads, tuple(lines))


def _loose_difference(cell: Cell) -> tuple[str, str]:
    """From the baseline to beat to the attack, at loose overlap, with its paired interval."""
    random = cell.strongest_random
    if random is None:
        return NOTHING, NOTHING
    points = cell.attacked.map_loose_ratio_percent - random.map_loose_ratio_percent
    draws = (cell.other_draws.get(key, ()) for key in ("random_best_loose", "loose"))
    return formatted_number(points, 2), interval(paired_interval(*draws))
