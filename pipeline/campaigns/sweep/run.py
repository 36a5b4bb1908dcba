"""A sweep: an attack and its evaluation at every budget of a table, and a report of all cells."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.bench import Bench
from advpipe.pipeline.campaigns.sweep.budgets import SweepBudget, choose_budgets
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings, Times
from advpipe.pipeline.campaigns.sweep.check import check_cells
from advpipe.pipeline.campaigns.sweep.document import print_document, write_document
from advpipe.pipeline.campaigns.sweep.options import SweepOptions
from advpipe.pipeline.campaigns.sweep.panel_pictures import panel_pictures
from advpipe.pipeline.campaigns.sweep.settings import sweep_settings
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.pipeline.campaigns.sweep.tables import paper_tables, recipes_of, records
from advpipe.pipeline.campaigns.sweep.variants import (
    seed_above,
    steps_factor,
    variant_parameters,
    with_seed_of,
    with_seeds,
)
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.progress import plan_progress, working_on
from advpipe.pipeline.core.tabular import Rows, Tabular, html_paragraph, html_table
from advpipe.pipeline.core.verbosity import detail, print_result
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.stages.evaluate.report.numbers import formatted_number
from advpipe.stages.evaluate.training_map import map_status

WRITING = "writing the report"


@dataclass(frozen=True)
class Sweep:
    """The requested cells of a clean bag, in a folder that keeps finished cells."""

    clean: Path
    store: Store
    bench: Bench
    settings: Settings
    budgets: tuple[SweepBudget, ...]
    options: SweepOptions

    @classmethod
    def prepared(cls, clean: Path, out: Path, options: SweepOptions) -> Sweep:
        """Raises AdvpipeError for everything that can be refused before hours of work."""
        with as_usage_error():
            budgets = tuple(choose_budgets(options.table, list(options.cells)))
        settings = sweep_settings(clean, options)
        bench = Bench(clean, out, options.detector, options.workers, options.keep_bags, options.device)
        prepared = cls(clean, Store(out), bench, settings, budgets, options)
        with as_usage_error():
            for recipe, budget in prepared.places():
                bench.request(budget, recipe, with_seed_of(recipe, settings)).check()
        count = len(list(prepared.places()))
        if not count:
            attacks = ", ".join(sorted({budget.attack for budget in budgets}))
            raise UsageError(f"no cell: {attacks} has no {' and no '.join(options.recipes)}")
        detail(f"{count} cells of {clean}: {options.detector} on {options.device}, seed {options.seed}")
        return prepared

    @property
    def recipes(self) -> tuple[str, ...]:
        """The recipes with all seeds."""
        return with_seeds(self.options.recipes, self.options.seeds)

    def places(self) -> Iterator[tuple[str, SweepBudget]]:
        """The cells by recipe and budget, but for variants that an attack does not have."""
        return (
            (recipe, budget)
            for recipe in self.recipes
            for budget in self.budgets
            if variant_parameters(recipe, budget.attack) is not None
        )

    def check(self, count: int) -> list[str]:
        """Compute so many finished cells again and compare them; returns their names, see `check_cells`."""
        return check_cells(self.bench, self.store, list(self.places()), count, self.options.seed)

    def run(self, overwrite: bool = False) -> SweepReport:
        """Run the cells that are missing, and write the report of all that the folder holds."""
        self.store.open(self.settings, list(self.recipes), overwrite)
        groups = self._missing()
        plan_progress({**{_group_name(*group): 10.0 * len(group[1]) for group in groups}, WRITING: 3})
        for budget, recipes in groups:
            self._run_group(budget, recipes)
        new = [recipe for _, recipes in groups for recipe in recipes]
        with working_on(WRITING):
            return self._write(new)

    def _write(self, new: Sequence[str]) -> SweepReport:
        """Write the report of the finished cells; new: recipes with a new one among them."""
        done = self.store.cells()
        shown = recipes_of(done, list(self.recipes))
        pictures = [
            picture
            for recipe in shown
            if steps_factor(recipe) == 1 and not seed_above(recipe)
            for picture in panel_pictures(self.bench, self.store, recipe, recipe in new)
        ]
        detector = load_detector(self.options.detector, self.options.device)
        of_map = map_status(self.options.detector, detector, BagReader(self.clean).provenance)
        report = SweepReport(self.store.folder, done, shown, [of_map.text] if of_map.text else [])
        commands = commands_of(self.clean, self.options.table, done)
        write_document(report.folder, done, shown, commands, pictures, report.warnings)
        return report

    def _missing(self) -> list[tuple[SweepBudget, list[str]]]:
        """The cells without results, by budget and seed: those of a group are evaluated together."""
        groups: dict[tuple[str, int], tuple[SweepBudget, list[str]]] = {}
        for recipe, budget in self.places():
            if self.store.load(recipe, budget.name) is not None:
                print_result(f"{cell_name(recipe, budget)}: kept")
                continue
            groups.setdefault((budget.name, seed_above(recipe)), (budget, []))[1].append(recipe)
        return list(groups.values())

    def _run_group(self, budget: SweepBudget, recipes: Sequence[str]) -> None:
        with working_on(_group_name(budget, recipes)):
            for cell, times in self.bench.run(budget, recipes, with_seed_of(recipes[0], self.settings)):
                self.store.save(cell, times)
                print_result(_line(cell, budget, times))


@dataclass(frozen=True, repr=False)
class SweepReport(Tabular):
    """What a sweep's folder holds now: report.html, report.json, and the finished cells."""

    folder: Path
    cells: Sequence[Cell]
    recipes: Sequence[str]
    warnings: Sequence[str]

    def __str__(self) -> str:
        names = ", ".join(cell.name for cell in self.cells)
        return f"{self.folder}: {names or 'no finished cell'}"

    def to_dicts(self) -> Rows:
        """A row a finished cell: recipe, attack and budget, the paper's figures, and those of report.json."""
        rows = []
        for record in records(self.cells, self.recipes):
            values = record.get("row")
            if isinstance(values, Mapping):
                about = {key: value for key, value in record.items() if key != "row"}
                rows.append({key: plain_value(value) for key, value in {**values, **about}.items()})
        return rows

    def _repr_html_(self) -> str:
        """The tables of report.html that compare with the paper."""
        tables = paper_tables(self.cells, self.recipes)
        return html_paragraph(self) + "".join(
            html_table(each.heads, each.lines, each.title) for each in tables
        )

    def show(self) -> None:
        """The tables on the terminal."""
        print_document(self.cells, self.recipes, self.warnings)


def cell_name(recipe: str, budget: SweepBudget) -> str:
    """The name of a cell that may not have been run yet."""
    return f"{recipe}-{budget.name}"


def _group_name(budget: SweepBudget, recipes: Sequence[str]) -> str:
    return f"{budget.name}: {', '.join(recipes)}"


def _line(cell: Cell, budget: SweepBudget, times: Times) -> str:
    return (
        f"{cell.name}: mAP ratio {formatted_number(cell.attacked.map_ratio_percent, 2)} % (the paper: "
        f"{formatted_number(budget.paper_map_ratio_percent, 2)} %), {len(cell.frames)} frames, "
        f"attack {times.attack_s:.0f} s, evaluation {times.evaluate_s:.0f} s"
    )


def commands_of(clean: Path, table: str, cells: Sequence[Cell]) -> str:
    """The commands that make the same cells: a line for each recipe, since their frames may differ."""
    of_recipe = {cell.recipe: cell.settings for cell in cells}
    return "\n".join(
        f"advpipe sweep {clean.parent.name}/{clean.name} --table {table} --recipe {recipe} "
        f"--frames {one.frames} --detector {one.detector} --seed {one.seed - seed_above(recipe)}"
        + (f" --baseline-tries {one.baseline_tries}" if one.baseline_tries else "")
        + (f" --lidar {one.lidar_topic}" if one.lidar_topic else "")
        + (f" --lidar-height {one.lidar_height_m:g}" if one.lidar_height_m is not None else "")
        + (" --level" if one.level else "")
        + (f" --scale-intensity {one.scale_intensity:g}" if one.scale_intensity != 1 else "")
        + (f" --device {one.device}" if one.device != "cpu" else "")
        + "".join(f" --defence {text}" for text in one.defences)
        + "".join(f" --detect-attacks {text}" for text in one.detect_attacks)
        for recipe, one in of_recipe.items()
    )
