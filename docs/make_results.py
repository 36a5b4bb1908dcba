"""Writes the tables of measured attacks into the README and pages of docs/, from cells in datasets/reports.

    python docs/make_results.py

It writes between `<!-- results: NAME FOLDER -->` and `<!-- end of results -->`: NAME is `about`, or one of
`TABLES`, FOLDER one of datasets/reports, written by `advpipe sweep`. A test compares the pages with it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from advpipe.pipeline.campaigns.sweep.budgets import TABLE_ONE, budget_named
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.campaigns.sweep.draws import Draws, paired_interval
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.campaigns.sweep.variants import by_seeds, by_steps, steps_factor
from advpipe.pipeline.results.row import RANDOM_BEST

ROOT = Path(__file__).resolve().parents[1]
REPORTS = ROOT / "datasets" / "reports"
BLOCK = re.compile(r"(<!-- results: (\S+) (\S+) -->\n).*?(<!-- end of results -->)", re.DOTALL)
PAGES = tuple(
    page
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    if BLOCK.search(page.read_text(encoding="utf-8"))
)

RECIPES = ("best", "hide", "robust", "stealthy", "paper", "paper+weighted")
"""In the order of tables."""

Lines = Iterator[Sequence[str]]
Text = Callable[[Mapping[str, Any]], str]


def attacks_table(cells: Sequence[Cell]) -> Lines:
    """Table I: what each recipe leaves, and the paired difference to random-best of as many tries."""
    yield (
        *("attack", "recipe", "strict, %", f"Δ to `{RANDOM}`", "loose, %", f"Δ to `{RANDOM}`, loose"),
        *("lost strictly, %", "lost loosely, %", "CD, m²", "RMS, mm"),
    )
    for budget in _budgets(cells):
        title, known = _title(budget), budget_named(budget)
        yield (
            *(title, "the paper's", f"{known.paper_map_ratio_percent:.1f}", "", "", "", "", ""),
            *(_plain(known.paper_chamfer_distance_m2), ""),
        )
        mine = _by_recipe(cells, budget)
        for recipe, cell in mine.items():
            yield ("", f"`{recipe}`", *_line(cell))
        if "best" in mine:
            yield ("", f"`{RANDOM}`", *_random_line(mine["best"]))


def short_table(cells: Sequence[Cell]) -> Lines:
    """Of the README: `best`, `hide` and random-best."""
    yield "attack", "recipe", "strict, %", f"Δ to `{RANDOM}`, points", "loose, %", "lost strictly, %"
    for budget in _budgets(cells):
        mine = _by_recipe(cells, budget)
        for place, recipe in enumerate(name for name in ("best", "hide") if name in mine):
            strict, delta, loose, _, lost, *_ = _line(mine[recipe])
            title = "" if place else _title(budget)
            yield title, f"`{recipe}`", strict, delta, loose, lost
        if "best" in mine:
            strict, _, loose, _, lost, *_ = _random_line(mine["best"])
            yield "", f"`{RANDOM}`", strict, "", loose, lost


def hidden_table(cells: Sequence[Cell]) -> Lines:
    """What `hide` leaves at loose overlap, paired with what `best` leaves."""
    yield "attack", "`best`, loose, %", "`hide`, loose, %", "`hide` minus `best`, points"
    for budget in _budgets(cells):
        mine = _by_recipe(cells, budget)
        if "hide" in mine and "best" in mine:
            best, hide = mine["best"], mine["hide"]
            points = hide.attacked.map_loose_ratio_percent - best.attacked.map_loose_ratio_percent
            yield (
                _title(budget),
                *(
                    _with(each.attacked.map_loose_ratio_percent, each.attacked.map_loose_ratio_ci95)
                    for each in (best, hide)
                ),
                _with(points, paired_interval(_draws(best, "loose"), _draws(hide, "loose")), "+"),
            )


def defences_table(cells: Sequence[Cell], kind: str = "") -> Lines:
    """What is left of the mAP of clean clouds, both under a defence, and the difference to random-best."""
    return _listed_lines(
        *(cells, "defences", "defence", "kept"),
        lambda record: f"{record[f'clean_map_{kind}kept_percent']:.1f}",
        partial(_under_defence, kind=kind),
    )


def checks_table(cells: Sequence[Cell]) -> Lines:
    """Which clouds attack checks detect."""
    return _listed_lines(
        *(cells, "attack_detection", "check", "false alarms"),
        lambda record: f"{record['false_positive_percent']:.0f}",
        lambda record: f"{record['true_positive_percent']:.0f}",
    )


def _listed_lines(
    cells: Sequence[Cell], key: str, name: str, about_clean: str, of_clean: Text, of_attacked: Text
) -> Lines:
    """A column for each record that cells list under `key`, called by its `name`: a line of the clean clouds,
    which all cells share, and one for each attack and recipe."""
    held = [cell for cell in cells if cell.listed.get(key)]
    by_name = {cell.name: {each[name]: each for each in cell.listed[key]} for cell in held}
    names = list(dict.fromkeys(each for records in by_name.values() for each in records))
    yield "attack", "recipe", *(f"`{each}`" for each in names)
    clean = by_name[held[0].name]
    yield "clean clouds", about_clean, *(of_clean(clean[each]) for each in names)
    for budget in _budgets(held):
        for place, (recipe, cell) in enumerate(_by_recipe(held, budget).items()):
            title = "" if place else _title(budget)
            yield title, f"`{recipe}`", *(of_attacked(by_name[cell.name][each]) for each in names)


def stealth_table(cells: Sequence[Cell]) -> Lines:
    """What `best` and `stealthy` leave, and how many clouds each check detects."""
    mine = [
        cell for cell in cells if cell.recipe in ("best", "stealthy") and cell.listed.get("attack_detection")
    ]
    head, clean, *lines = checks_table(mine)
    yield *head[:2], "strict, %", "loose, %", *head[2:]
    yield *clean[:2], "", "", *clean[2:]
    in_order = (cell for budget in _budgets(mine) for cell in _by_recipe(mine, budget).values())
    for cell, line in zip(in_order, lines, strict=True):
        attacked = cell.attacked
        strict = _with(attacked.map_ratio_percent, attacked.map_ratio_ci95)
        yield *line[:2], strict, f"{attacked.map_loose_ratio_percent:.1f}", *line[2:]


def ranges_table(cells: Sequence[Cell]) -> Lines:
    """Objects lost strictly, in percent of those found in the clean clouds, by range."""
    held = [cell for cell in cells if cell.listed.get("attack_success")]
    names = list(dict.fromkeys(each["range"] for cell in held for each in cell.listed["attack_success"]))
    yield "attack", "recipe", *(f"{name}: strictly, loosely" for name in names)
    for budget in _budgets(held):
        mine = _by_recipe(held, budget)
        for place, (recipe, cell) in enumerate(mine.items()):
            yield "" if place else _title(budget), f"`{recipe}`", *_lost(cell, names, "adv")
        if "best" in mine:
            yield "", f"`{RANDOM}`", *_lost(mine["best"], names, RANDOM_BEST)


def seeds_table(cells: Sequence[Cell]) -> Lines:
    """The same frames attacked with several seeds."""
    yield "attack", "recipe", "seeds", "strict, %", "loose, %", f"`{RANDOM}`, strict, %", "loose, %"
    for family in by_seeds(cells).values():
        random = [cell.strongest_random for cell in family]
        columns = [
            [cell.attacked.map_ratio_percent for cell in family],
            [cell.attacked.map_loose_ratio_percent for cell in family],
            [each.map_ratio_percent for each in random if each],
            [each.map_loose_ratio_percent for each in random if each],
        ]
        seeds = ", ".join(str(cell.settings.seed) for cell in family)
        texts = (", ".join(f"{value:.1f}" for value in values) for values in columns)
        yield _title(family[0].budget), f"`{family[0].recipe}`", seeds, *texts


def convergence_table(cells: Sequence[Cell]) -> Lines:
    """What other numbers of steps leave, and the paired difference of twice the steps."""
    yield "attack", "steps", "strict, %", "twice as many, points", "loose, %", "twice as many, points"
    for family in by_steps(cells).values():
        by_factor = {steps_factor(cell.recipe): cell for cell in family}
        for factor, cell in by_factor.items():
            texts = []
            for key, ratio in (("strict", "map_ratio"), ("loose", "map_loose_ratio")):
                here = getattr(cell.attacked, f"{ratio}_percent")
                texts.append(_with(here, getattr(cell.attacked, f"{ratio}_ci95")))
                after = by_factor.get(2 * factor)
                points = (
                    ""
                    if after is None
                    else _with(
                        getattr(after.attacked, f"{ratio}_percent") - here,
                        paired_interval(_draws(cell, key), _draws(after, key)),
                        "+",
                    )
                )
                texts.append(points)
            yield _title(cell.budget), f"× {factor:g}", *texts


TABLES: Mapping[str, Callable[[Sequence[Cell]], Lines]] = {
    "attacks": attacks_table,
    "short": short_table,
    "hidden": hidden_table,
    "defences": defences_table,
    "loose-defences": partial(defences_table, kind="loose_"),
    "checks": checks_table,
    "stealth": stealth_table,
    "ranges": ranges_table,
    "seeds": seeds_table,
    "convergence": convergence_table,
}

RANDOM = RANDOM_BEST.replace("_", "-")


def about(cells: Sequence[Cell]) -> str:
    """What was measured on what."""
    settings, row = cells[0].settings, cells[0].row
    seeds = sorted({cell.settings.seed for cell in cells})
    boxes = ", ".join(
        f"{count:,} of class {name}{'' if name in row.counts.classes_in_map else ' (too few for the mAP)'}"
        for name, count in row.boxes.items()
        if count
    )
    strict, loose = (row.clean.means[each].map_r40 for each in ("strict", "loose"))
    return (
        f"Detector `{settings.detector}` (SHA-256 {settings.detector_sha256[:8]}…), {row.counts.frames} "
        f"clouds (`--frames {settings.frames}`), {'seed' if len(seeds) == 1 else 'seeds'} "
        f"{' and '.join(map(str, seeds))}. Evaluated objects: {boxes}. mAP is the mean of 3D AP (R40) over "
        f"the classes: {strict:.3f} strictly and {loose:.3f} loosely in the clean clouds. Lost is an object "
        f"that was found in the clean cloud with a score of at least {row.counts.working_score:.2f}, and is "
        "not found in the attacked one."
    )


def with_tables(page: str) -> str:
    """The text of a page with all of its tables made anew."""
    return BLOCK.sub(lambda found: found[1] + _markdown(found[2], found[3]) + found[4], page)


def _markdown(name: str, folder: str) -> str:
    cells = Store(REPORTS / folder).cells()
    if name == "about":
        return f"\n{about(cells)}\n\n"
    head, *lines = TABLES[name](cells)
    rows = [head, ["---"] * len(head), *lines]
    return "\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows) + "\n"


def _budgets(cells: Sequence[Cell]) -> list[str]:
    """Those of Table I first, in its order, as far as there are cells."""
    found = list(dict.fromkeys(cell.budget for cell in cells))
    return sorted(found, key=lambda name: (name not in TABLE_ONE, [*TABLE_ONE, *found].index(name)))


def _by_recipe(cells: Sequence[Cell], budget: str) -> dict[str, Cell]:
    found = {cell.recipe: cell for cell in cells if cell.budget == budget}
    return {recipe: found[recipe] for recipe in RECIPES if recipe in found}


def _title(budget: str) -> str:
    known = budget_named(budget)
    return f"`{known.attack}`, {known.title}"


def _line(cell: Cell) -> tuple[str, ...]:
    attacked, row = cell.attacked, cell.row
    random = row.baselines[RANDOM_BEST]
    loose = attacked.map_loose_ratio_percent - random.metrics.map_loose_ratio_percent
    loose_bounds = paired_interval(_draws(cell, "random_best_loose"), _draws(cell, "loose"))
    lost = _success(cell, "adv")["all"]
    return (
        _with(attacked.map_ratio_percent, attacked.map_ratio_ci95),
        _with(random.map_ratio_delta_points, random.map_ratio_delta_points_ci95, "+"),
        _with(attacked.map_loose_ratio_percent, attacked.map_loose_ratio_ci95),
        _with(loose, loose_bounds, "+"),
        f"{lost['strict_attack_success_percent']:.0f}",
        f"{lost['attack_success_percent']:.0f}",
        _plain(attacked.chamfer_distance_m2),
        f"{1000 * attacked.rms_displacement_m:.1f}" if attacked.points_moved else "",
    )


def _random_line(cell: Cell) -> tuple[str, ...]:
    random, lost = cell.row.baselines[RANDOM_BEST].metrics, _success(cell, RANDOM_BEST)["all"]
    return (
        _with(random.map_ratio_percent, random.map_ratio_ci95),
        "",
        _with(random.map_loose_ratio_percent, random.map_loose_ratio_ci95),
        "",
        f"{lost['strict_attack_success_percent']:.0f}",
        f"{lost['attack_success_percent']:.0f}",
        _plain(random.chamfer_distance_m2),
        f"{1000 * random.rms_displacement_m:.1f}" if random.points_moved else "",
    )


def _lost(cell: Cell, ranges: Sequence[str], condition: str) -> Iterator[str]:
    of_range = _success(cell, condition)
    for name in ranges:
        each = of_range[name]
        yield f"{each['strict_attack_success_percent']:.0f}, {each['attack_success_percent']:.0f}"


def _success(cell: Cell, condition: str) -> dict[str, Mapping[str, Any]]:
    """What became of objects under a condition, by range."""
    records = cell.listed["attack_success"]
    return {each["range"]: each for each in records if each["condition"] == condition}


def _under_defence(record: Mapping[str, Any], kind: str) -> str:
    bounds = record[f"map_{kind}ratio_delta_points_vs_random_best_ci95"]
    points = record[f"map_{kind}ratio_delta_points_vs_random_best"]
    return f"{record[f'map_{kind}ratio_percent']:.1f} [{_with(points, bounds and tuple(bounds), '+')}]"


def _draws(cell: Cell, key: str) -> Draws:
    return cell.map_ratio_draws if key == "strict" else cell.other_draws[key]


def _with(value: float, bounds: tuple[float, float] | None, sign: str = "") -> str:
    text = f"{value:{sign}.1f}"
    if bounds is not None:
        text += f" ({bounds[0]:{sign}.1f}…{bounds[1]:{sign}.1f})"
    return text.replace("-", "−")


def _plain(value: float) -> str:
    return f"{value:.2g}"


def main() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        if (made := with_tables(text)) != text:
            page.write_text(made, encoding="utf-8")
            print(f"{page.relative_to(ROOT)}: tables made anew", file=sys.stderr)


if __name__ == "__main__":
    main()
