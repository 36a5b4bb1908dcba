"""The paper's two tables, with its figures beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import isnan

import numpy as np

from advpipe.pipeline.campaigns.sweep.budgets import AXES, BUDGETS, TABLE_ONE, TABLES, SweepBudget
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.draws import paired_interval
from advpipe.pipeline.campaigns.sweep.variants import by_seeds, by_steps, split_recipe, steps_factor
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.metrics import CloudMetrics
from advpipe.stages.evaluate.detection.baseline import BEST, baseline_title
from advpipe.stages.evaluate.report.numbers import (
    NOTHING,
    formatted_number,
    interval,
    short_name,
    with_interval,
)
from advpipe.stages.evaluate.report.section import Table
from advpipe.stages.evaluate.report.table import changed_percent

NOT_RUN = "not run"

RANDOM = "random baseline"
"""`random-best`; in cells of older versions, which have none, the strongest of the plain ones."""

HEADS = (
    "attack", "paper: ratio %", "CD m²", "ours: strict ratio %", "95 %", "loose ratio %", "95 %", "CD m²",
    "below paper", f"{RANDOM}: strict ratio %", "loose ratio %", "Δ to it, points", "95 %", "significant",
    "max shift m",
    "RMS shift m", "points", "frames",
)  # fmt: skip

ON_THE_TERMINAL = {
    0: "attack", 1: "paper %", 3: "strict %", 4: "95 %", 5: "loose %", 7: "CD m²", 9: "random\n%",
    10: "loose %", 13: "signi-\nficant",
}  # fmt: skip
"""The places in `HEADS` of what fits into 80 characters, and shorter heads."""

SMALL_CHANGE_POINTS = 2.0
"""Twice the steps that change the mAP ratio by less than so many points change little."""

ANSWER = {True: "yes", False: "no", None: NOTHING}


def recipes_of(cells: Sequence[Cell], asked: Sequence[str] = ()) -> list[str]:
    """The recipes that tables have lines for: those asked for, then others that were run before."""
    return list(dict.fromkeys([*asked, *sorted({cell.recipe for cell in cells})]))


def table_one(cells: Sequence[Cell], recipes: Sequence[str]) -> Table:
    """Table I: the attacks side by side, a line for the paper and one for each recipe and its baseline."""
    found = {(cell.recipe, cell.budget): cell for cell in cells}
    heads = ["detector and recipe"]
    for name in TABLE_ONE:
        heads += [f"{name.replace('-', ' ')}: CD m²", "strict ratio %", "loose ratio %"]
    lines = [["SECOND, the paper's figures"]]
    budgets = {budget.name: budget for budget in TABLES["paper"]}
    for name in TABLE_ONE:
        lines[0] += [
            formatted_number(budgets[name].paper_chamfer_distance_m2, 5),
            formatted_number(budgets[name].paper_map_ratio_percent, 2),
            NOTHING,
        ]
    for recipe in recipes:
        here = [found.get((recipe, name)) for name in TABLE_ONE]
        seen = next((cell for cell in here if cell), None)
        about = f"{short_name(seen.settings.detector)}, {len(seen.frames)} frames, " if seen else ""
        lines.append([f"{about}recipe {recipe}"])
        lines.append([f"  {RANDOM}"])
        for cell in here:
            if cell is None:
                lines[-2] += [NOT_RUN] * 3
                lines[-1] += [NOTHING] * 3
                continue
            lines[-2] += _distance_and_ratios(cell.attacked)
            lines[-1] += _distance_and_ratios(cell.strongest_random)
    return Table("Table I", tuple(heads), tuple(tuple(cell_line) for cell_line in lines))


def paper_tables(cells: Sequence[Cell], recipes: Sequence[str]) -> list[Table]:
    """The tables that stand beside the paper's: I, and II by attack."""
    return [table_one(cells, recipes), *(table_two(cells, recipes, attack) for attack in AXES)]


def table_two(cells: Sequence[Cell], recipes: Sequence[str], attack: str) -> Table:
    """The part of Table II about one attack: a line for each budget and recipe.

    Variants of a recipe, and budgets of the paper's text alone, have lines where they were run.
    """
    found = {(cell.recipe, cell.budget): cell for cell in cells}
    lines = [
        cell_line(budget, recipe, found.get((recipe, budget.name)))
        for budget in BUDGETS
        if budget.attack == attack
        for recipe in recipes
        if (recipe, budget.name) in found or (budget in TABLES["paper"] and not split_recipe(recipe)[1])
    ]
    return Table(f"Table II: {AXES[attack].title}", HEADS, tuple(lines))


def cell_line(budget: SweepBudget, recipe: str, cell: Cell | None) -> tuple[str, ...]:
    """The cells of `HEADS`; of the random baselines, the one to beat."""
    known = (
        f"{budget.title}, {recipe}",
        formatted_number(budget.paper_map_ratio_percent, 2),
        formatted_number(budget.paper_chamfer_distance_m2, 5),
    )
    if cell is None:
        return (*known, NOT_RUN, *[NOTHING] * (len(HEADS) - len(known) - 1))
    attacked, strongest = cell.attacked, cell.row.strongest_baseline
    random = cell.row.baselines[strongest] if strongest else None
    return (
        *known,
        formatted_number(attacked.map_ratio_percent, 2),
        interval(attacked.map_ratio_ci95),
        formatted_number(attacked.map_loose_ratio_percent, 2),
        interval(attacked.map_loose_ratio_ci95),
        formatted_number(attacked.chamfer_distance_m2, 5),
        ANSWER[below_paper(budget, cell)],
        formatted_number(random.metrics.map_ratio_percent, 2) if random else NOTHING,
        formatted_number(random.metrics.map_loose_ratio_percent, 2) if random else NOTHING,
        formatted_number(random.map_ratio_delta_points, 2) if random else NOTHING,
        interval(random.map_ratio_delta_points_ci95) if random else NOTHING,
        ANSWER[cell.row.significant_vs_random],
        formatted_number(max(attacked.max_displacement_m, attacked.max_added_m), 4),
        formatted_number(attacked.rms_displacement_m or None, 4),
        changed_percent(
            attacked.points_removed,
            attacked.points_added,
            attacked.points_moved,
            cell.row.counts.points_clean,
        ),
        formatted_number(cell.row.counts.frames, 0),
    )


def convergence_table(cells: Sequence[Cell]) -> Table:
    """What more steps change, of the cells that were run with other numbers of them, too; drawn together."""
    heads = (
        *("cell", "steps", "ratio %", "95 %", "twice as many change", "95 %"),
        *(f"surely under {SMALL_CHANGE_POINTS:g} points", "surely more"),
    )
    lines = []
    for name, family in by_steps(cells).items():
        factors = {steps_factor(cell.recipe): cell for cell in family}
        for factor, cell in factors.items():
            after = factors.get(2 * factor)
            points, bounds = (None, None) if after is None else step(cell, after)
            is_small = is_large = None
            if bounds is not None:
                is_small = bounds[0] > -SMALL_CHANGE_POINTS and bounds[1] < SMALL_CHANGE_POINTS
                is_large = bounds[0] > SMALL_CHANGE_POINTS or bounds[1] < -SMALL_CHANGE_POINTS
            lines.append(
                (
                    *(name, f"x {factor:g}", formatted_number(cell.attacked.map_ratio_percent, 2)),
                    interval(cell.attacked.map_ratio_ci95),
                    *(formatted_number(points, 2), interval(bounds), ANSWER[is_small], ANSWER[is_large]),
                )
            )
    title = (
        f"What more steps change; surely under {SMALL_CHANGE_POINTS:g} points where the whole interval is, "
        f"surely more where it is wholly beyond"
    )
    return Table(title, heads, tuple(lines))


def seeds_table(cells: Sequence[Cell]) -> Table:
    """The mean over seeds, and the least and the largest, of cells that were run with several seeds."""
    heads = ("cell", "seeds", "strict ratio %", "least to largest", "loose ratio %", "least to largest")
    lines = []
    for name, family in by_seeds(cells).items():
        random = [cell.strongest_random for cell in family]
        for title, found in ((name, [cell.attacked for cell in family]), (f"  {RANDOM}", random)):
            metrics = [each for each in found if each is not None]
            strict = _over_seeds([each.map_ratio_percent for each in metrics])
            loose = _over_seeds([each.map_loose_ratio_percent for each in metrics])
            lines.append((title, ", ".join(str(cell.settings.seed) for cell in family), *strict, *loose))
    return Table("Spread over seeds: the same frames, attacked again", heads, tuple(lines))


def baselines_table(cells: Sequence[Cell]) -> Table:
    """Every baseline of every cell: its ratio, and the paired difference to it."""
    heads = (
        *("cell", "random baseline", "tries", "query budget of the attack"),
        *("baseline's ratio %", "95 %", "Δ to baseline, points", "95 %", "significant"),
        *("loose ratio %", "Δ, loose", "95 %"),
    )
    lines = [
        (
            cell.name,
            baseline_title(name),
            formatted_number(cell.row.attack.baseline_tries if name.endswith(BEST) else 1, 0),
            formatted_number(cell.row.attack.query_budget, 0),
            formatted_number(baseline.metrics.map_ratio_percent, 2),
            interval(baseline.metrics.map_ratio_ci95),
            formatted_number(baseline.map_ratio_delta_points, 2),
            interval(baseline.map_ratio_delta_points_ci95),
            ANSWER[baseline.is_significant],
            formatted_number(baseline.metrics.map_loose_ratio_percent, 2),
            formatted_number(baseline.map_loose_ratio_delta_points, 2),
            interval(baseline.map_loose_ratio_delta_points_ci95),
        )
        for cell in cells
        for name, baseline in cell.row.baselines.items()
    ]
    return Table("Against random baselines of equal budget", heads, tuple(lines))


def budget_table(cells: Sequence[Cell]) -> Table:
    """From each budget that was run to the next: what it does to the mAP ratio, drawn together."""
    heads = ("recipe", "from", "to", "change in mAP ratio", "95 %", "rises beyond it")
    lines = []
    for recipe in recipes_of(cells):
        mine = {cell.budget: cell for cell in cells if cell.recipe == recipe}
        for attack in AXES:
            run = [mine[each.name] for each in BUDGETS if each.attack == attack and each.name in mine]
            for before, after in pairwise(run):
                points, bounds = step(before, after)
                rises = None if bounds is None else bounds[0] > 0
                change = (formatted_number(points, 2), interval(bounds), ANSWER[rises])
                lines.append((recipe, before.budget, after.budget, *change))
    return Table("From budget to budget", heads, tuple(lines))


def step(before: Cell, after: Cell) -> tuple[float | None, tuple[float, float] | None]:
    """Points of mAP ratio that `after` has more than `before`, and the paired 95 % interval; None without.

    Only cells of the same frames and seed were drawn together.
    """
    change = after.attacked.map_ratio_percent - before.attacked.map_ratio_percent
    points = None if isnan(change) else change
    paired = (before.frames, before.settings.seed) == (after.frames, after.settings.seed)
    return points, paired_interval(before.map_ratio_draws, after.map_ratio_draws) if paired else None


def below_paper(budget: SweepBudget, cell: Cell) -> bool | None:
    """Whether the mAP ratio is below the paper's, and the Chamfer distance not above; None if undefined."""
    ratio, distance = cell.attacked.map_ratio_percent, cell.attacked.chamfer_distance_m2
    if isnan(ratio) or isnan(distance) or isnan(budget.paper_map_ratio_percent):
        return None
    return ratio < budget.paper_map_ratio_percent and distance <= budget.paper_chamfer_distance_m2


def records(cells: Sequence[Cell], recipes: Sequence[str]) -> list[Mapping[str, object]]:
    """One a budget and recipe, as `report.json` lists them; of a cell that was not run, the paper's alone.

    Variants of a recipe are listed where they were run.
    """
    found = {(cell.recipe, cell.budget): cell for cell in cells}
    listed: list[Mapping[str, object]] = []
    for recipe in recipes:
        for budget in BUDGETS:
            about: dict[str, object] = {
                "cell": budget.name,
                "recipe": recipe,
                "attack": budget.attack,
                "parameters": budget.parameters,
                "paper_map_ratio_percent": plain_value(budget.paper_map_ratio_percent),
                "paper_chamfer_distance_m2": plain_value(budget.paper_chamfer_distance_m2),
                "status": NOT_RUN,
            }
            cell = found.get((recipe, budget.name))
            if cell is None and (split_recipe(recipe)[1] or budget not in TABLES["paper"]):
                continue
            if cell:
                about |= {
                    "status": "done",
                    "is_below_paper": below_paper(budget, cell),
                    "strongest_baseline": cell.row.strongest_baseline,
                    "bag_sha256": cell.bag_sha256,
                    "frames": cell.settings.frames,
                    "row": plain_value(cell.row.record()),
                    **cell.listed,
                }
            listed.append(about)
    return listed


def _over_seeds(values: Sequence[float]) -> tuple[str, str]:
    """The mean, and the range."""
    if not values:
        return NOTHING, NOTHING
    return formatted_number(float(np.mean(values)), 2), interval((min(values), max(values)))


def _distance_and_ratios(metrics: CloudMetrics | None) -> list[str]:
    if metrics is None:
        return [NOTHING] * 3
    strict = with_interval(metrics.map_ratio_percent, metrics.map_ratio_ci95, 2)
    loose = with_interval(metrics.map_loose_ratio_percent, metrics.map_loose_ratio_ci95, 2)
    return [formatted_number(metrics.chamfer_distance_m2, 5), strict, loose]
