"""The command that attacks and evaluates at every budget of a table."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from advpipe.pipeline.cli.evaluate import detector_slug
from advpipe.pipeline.cli.shared import (
    Answer,
    BaselineTries,
    DetectorName,
    Device,
    LidarTopic,
    Overwrite,
    Workers,
)

if TYPE_CHECKING:
    from advpipe.pipeline.campaigns.sweep.budgets import Budget
    from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings, Times
    from advpipe.pipeline.campaigns.sweep.store import Store
    from advpipe.stages.attack.run import AttackRequest
    from advpipe.stages.evaluate.report.section import Picture

USUAL_FRAMES = 100

RECIPES_HELP = (
    "Recipes of the attacks: best,paper,random-best; best+half and best+twice take other steps, best+hide "
    "hides."
)


def sweep(
    bag: Annotated[
        Path | None, typer.Argument(help="Clean bag or its data set.", show_default="newest data set")
    ] = None,
    table: Annotated[str, typer.Option(help="Whose budgets: paper (all 18 of its Table II).")] = "paper",
    recipes: Annotated[str, typer.Option("--recipes", "--recipe", help=RECIPES_HELP)] = "best",
    cells: Annotated[
        list[str] | None,
        typer.Option(
            "--cells", help="Some budgets only: perturb-10,detach-1; repeatable.", show_default="all"
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(help="start:stop:step.", show_default="at most 100, equally spaced over the bag"),
    ] = None,
    detector: DetectorName = "small",
    device: Device = "cpu",
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the attacks, the baselines and the bootstrap.")
    ] = 0,
    baseline_tries: BaselineTries = None,
    lidar: LidarTopic = None,
    keep_bags: Annotated[
        bool, typer.Option("--keep-bags", help="Keep the adversarial bags that are made, in bags/.")
    ] = False,
    check: Annotated[
        int | None,
        typer.Option(min=1, help="Only compute so many finished cells again, drawn by --seed, and compare."),
    ] = None,
    workers: Workers = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder.", show_default="reports/sweep-<detector> of the data set"),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Attack and evaluate at every budget of the paper's tables; goes on where it was stopped.

    Each finished cell is kept in cells/ of the output, and only those that are missing are run. Other
    recipes, with frames of their own, may be added to the same output later.
    """
    from advpipe.pipeline.bag.locate import newest_dataset, resolve_bag
    from advpipe.pipeline.bag.reader import BagReader
    from advpipe.pipeline.campaigns.sweep.budgets import choose_budgets
    from advpipe.pipeline.campaigns.sweep.document import print_document, write_document
    from advpipe.pipeline.campaigns.sweep.settings import sweep_settings
    from advpipe.pipeline.campaigns.sweep.store import Store
    from advpipe.pipeline.campaigns.sweep.tables import recipes_of
    from advpipe.pipeline.campaigns.sweep.variants import steps_factor
    from advpipe.pipeline.core.errors import wrong_use
    from advpipe.pipeline.core.verbosity import detail, say
    from advpipe.pipeline.detector.registry import load_detector
    from advpipe.pipeline.process.folder import here, refuse_undecodable
    from advpipe.stages.evaluate.report.numbers import number
    from advpipe.stages.evaluate.training_map import map_status

    with wrong_use():
        clean = resolve_bag(bag or newest_dataset(here("datasets")))
        named = [word.strip() for words in cells or [] for word in words.split(",") if word.strip()]
        budgets = choose_budgets(table, named)
    asked = list(dict.fromkeys(word.strip() for word in recipes.split(",") if word.strip())) or ["best"]
    settings = sweep_settings(clean, detector, frames, seed, baseline_tries, lidar, USUAL_FRAMES, device)
    target = out or clean.parent / "reports" / f"sweep-{detector_slug(detector)}"
    refuse_undecodable(clean, target)
    store, bench = Store(target), _Bench(clean, target, detector, workers, keep_bags, device)
    with wrong_use():
        for recipe in asked:
            for budget in budgets:
                bench.request(budget, recipe, settings).check()  # rather now than hours later
    detail(f"{len(asked) * len(budgets)} cells of {clean}: {detector} on {device}, seed {seed}")
    if check is not None:
        places = [(recipe, budget) for recipe in asked for budget in budgets]
        checked = _check(bench, store, places, check, seed)
        return Answer({"checked": checked}, lambda: None)
    store.open(settings, asked, overwrite)
    is_new = dict.fromkeys(asked, False)
    for recipe in asked:
        for budget in budgets:
            if store.load(recipe, budget.name) is not None:
                say(f"{recipe}-{budget.name}: kept")
                continue
            cell, times = bench.run(budget, recipe, settings)
            store.save(cell, times)
            is_new[recipe] = True
            say(
                f"{cell.name}: mAP ratio {number(cell.row['map_ratio_percent'], 2)} % (the paper: "
                f"{budget.paper_map_ratio_percent:.2f} %), {len(cell.frames)} frames, "
                f"attack {times.attack_s:.0f} s, evaluation {times.evaluate_s:.0f} s"
            )
    done = store.cells()
    shown = recipes_of(done, asked)
    pictures = [
        picture
        for recipe in shown
        if steps_factor(recipe) == 1
        for picture in _panels(bench, store, recipe, is_new.get(recipe, False))
    ]
    of_map = map_status(detector, load_detector(detector, device), BagReader(clean).provenance)
    banners = [of_map.text] if of_map.text else []
    write_document(target, done, shown, _commands(clean, table, done), pictures, banners)

    def show() -> None:
        print_document(done, shown, banners)
        print(f"report: {target / 'report.html'}")

    document = json.loads((target / "report.json").read_text(encoding="utf-8"))
    return Answer({"report": target / "report.html", **document}, show)


@dataclass(frozen=True)
class _Bench:
    """Where cells are run: stage 2 makes a bag, stage 3 scores it, and it goes unless it is to be kept."""

    clean: Path
    out: Path
    detector: str
    workers: int | None
    keep_bags: bool = False
    device: str = "cpu"

    def request(self, budget: Budget, recipe: str, settings: Settings) -> AttackRequest:
        from advpipe.pipeline.campaigns.sweep.budgets import AXES
        from advpipe.pipeline.campaigns.sweep.variants import HIDE, split_recipe, steps_factor
        from advpipe.pipeline.scenario.attacks import attack_spec
        from advpipe.stages.attack.lidar.build import build_lidar_attack
        from advpipe.stages.attack.run import AttackRequest

        base, variants = split_recipe(recipe)
        parameters: dict[str, Any] = {**budget.parameters, **({"goal": "hide"} if HIDE in variants else {})}
        if (factor := steps_factor(recipe)) != 1:
            once = build_lidar_attack(
                attack_spec({"type": budget.attack, "recipe": base, "parameters": parameters})
            )
            steps = AXES[budget.attack].steps
            parameters[steps] = max(1, round(factor * getattr(once, steps)))
        spec = attack_spec(
            {
                "type": budget.attack,
                "recipe": base,
                "parameters": parameters,
                "frames": settings.frames,
                "detector": self.detector,
                "lidar": settings.lidar_topic,
            }
        )
        return AttackRequest((spec,), settings.seed, self.device)

    def attack(self, budget: Budget, recipe: str, settings: Settings, bag: Path) -> None:
        """The bag of a budget; one that a killed run has finished is taken as it is."""
        from advpipe.pipeline.bag.reader import BagReader
        from advpipe.pipeline.core.errors import writing
        from advpipe.stages.attack.provenance import provenance_of, resolved_text
        from advpipe.stages.attack.run import attack

        request, made = self.request(budget, recipe, settings), bag / "attack.yaml"
        if made.is_file():
            wanted = resolved_text(provenance_of(BagReader(self.clean), request))
            if made.read_text(encoding="utf-8") == wanted:
                return
        with writing(bag):
            attack(self.clean, bag, request, overwrite=bag.exists(), workers=self.workers)

    def run(self, budget: Budget, recipe: str, settings: Settings) -> tuple[Cell, Times]:
        """A cell, from the attack to the figures, and what it took."""
        from advpipe.pipeline.campaigns.sweep.cell import Times
        from advpipe.pipeline.campaigns.sweep.scored import scored_cell

        bag = self.out / "bags" / f"{recipe}-{budget.name}"
        begin_s = time.perf_counter()
        self.attack(budget, recipe, settings, bag)
        attacked_s = time.perf_counter()
        cell = scored_cell(
            self.clean,
            bag,
            budget.name,
            recipe,
            settings,
            detector=self.detector,
            workers=self.workers,
            device=self.device,
        )
        if not self.keep_bags:
            self.tidy(bag)
        return cell, Times(round(attacked_s - begin_s, 1), round(time.perf_counter() - attacked_s, 1))

    def tidy(self, folder: Path) -> None:
        from advpipe.pipeline.core.partial import remove_output

        remove_output(folder)
        if folder.parent.is_dir() and not any(folder.parent.iterdir()):
            folder.parent.rmdir()


def _check(
    bench: _Bench, store: Store, places: Sequence[tuple[str, Budget]], count: int, seed: int
) -> list[str]:
    """Compute some of the stored cells again, as they were made; raises AdvpipeError where one differs.

    By the code that there is: figures that stay the same show that a change of it changed nothing.
    """
    from advpipe.pipeline.campaigns.sweep.compare import differences
    from advpipe.pipeline.campaigns.sweep.settings import refuse_other_work, with_this_code
    from advpipe.pipeline.core.errors import AdvpipeError, UsageError
    from advpipe.pipeline.core.seeding import named_generator
    from advpipe.pipeline.core.verbosity import say

    stored = [(cell, budget) for recipe, budget in places if (cell := store.load(recipe, budget.name))]
    if not stored:
        raise UsageError(f"{store.folder} holds none of these cells; run the sweep first")
    drawn = named_generator(seed, "sweep", "check").permutation(len(stored))[:count]
    again = replace(bench, out=store.folder / "check", keep_bags=False)
    wrong: list[str] = []
    checked: list[str] = []
    for cell, budget in (stored[place] for place in sorted(drawn)):
        refuse_other_work(cell, bench.clean, bench.detector, bench.device)
        now = with_this_code(cell.settings)
        found = differences(cell, again.run(budget, cell.recipe, now)[0])
        same = "the same" if now == cell.settings else "the same, though other code of advpipe made it"
        say(f"{cell.name}: {'; '.join(found[:5]) or same}")
        checked.append(cell.name)
        wrong += [cell.name] if found else []
    again.tidy(again.out)
    if wrong:
        raise AdvpipeError(f"computed again, {', '.join(wrong)} differ from what {store.folder} holds")
    return checked


def _panels(bench: _Bench, store: Store, recipe: str, is_new: bool) -> list[Picture]:
    """The four-panel figure of a recipe whose three cells were run; drawn again if any cell is new."""
    from advpipe.pipeline.campaigns.sweep.budgets import budget_named
    from advpipe.pipeline.campaigns.sweep.panels import PANELS, RULE, draw_panels, load_scenes, median_frame
    from advpipe.stages.evaluate.report.pictures import to_png
    from advpipe.stages.evaluate.report.section import OVERVIEW, Picture

    by_name = {cell.budget: cell for cell in store.cells() if cell.recipe == recipe}
    chosen = [by_name[name] for name in PANELS if name in by_name]
    if len(chosen) < len(PANELS):
        return []
    frame = median_frame(chosen)
    if frame is None:
        return []
    caption = f"Recipe {recipe}, frame {frame} of the clean bag: {RULE}. Truth in blue, predictions in red."
    path = store.panels(recipe)
    bags = [bench.out / "bags" / f"frame-{cell.name}" for cell in chosen]
    if not is_new and path.is_file():
        for bag in bags:  # of a run that was killed while it drew
            bench.tidy(bag)
        return [Picture(OVERVIEW, "", path.name, caption, path.read_bytes())]
    for cell, bag in zip(chosen, bags, strict=True):
        bench.attack(budget_named(cell.budget), recipe, replace(cell.settings, frames=str(frame)), bag)
    scenes = load_scenes(bench.clean, bags, bench.detector, frame, chosen, bench.device)
    for bag in bags:
        bench.tidy(bag)
    titles = [f"{budget.attack} {budget.title}" for budget in map(budget_named, PANELS)]
    figure = draw_panels(scenes, titles, f"Recipe {recipe}, frame {frame}")
    return [Picture(OVERVIEW, "", path.name, caption, to_png(figure))]


def _commands(clean: Path, table: str, cells: Sequence[Cell]) -> str:
    """What to type for the same cells: a line for each recipe, which may have frames of its own."""
    of_recipe = {cell.recipe: cell.settings for cell in cells}
    return "\n".join(
        f"advpipe sweep {clean.parent.name}/{clean.name} --table {table} --recipe {recipe} "
        f"--frames {one.frames} --detector {one.detector} --seed {one.seed}"
        + (f" --baseline-tries {one.baseline_tries}" if one.baseline_tries else "")
        + (f" --lidar {one.lidar_topic}" if one.lidar_topic else "")
        + (f" --device {one.device}" if one.device != "cpu" else "")
        for recipe, one in of_recipe.items()
    )
