"""The picture of one frame at three budgets, kept with a sweep."""

from __future__ import annotations

from dataclasses import replace

from advpipe.pipeline.campaigns.sweep.bench import Bench
from advpipe.pipeline.campaigns.sweep.budgets import budget_named
from advpipe.pipeline.campaigns.sweep.panels import PANELS, RULE, draw_panels, load_scenes, median_frame
from advpipe.pipeline.campaigns.sweep.store import Store
from advpipe.stages.evaluate.report.pictures import to_png
from advpipe.stages.evaluate.report.section import OVERVIEW, ReportPicture


def panel_pictures(bench: Bench, store: Store, recipe: str, is_new: bool) -> list[ReportPicture]:
    """The four-panel figure of a recipe whose three cells were run; drawn again if any cell is new."""

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
        return [ReportPicture(OVERVIEW, "", path.name, caption, path.read_bytes())]
    for cell, bag in zip(chosen, bags, strict=True):
        bench.attack(budget_named(cell.budget), recipe, replace(cell.settings, frames=str(frame)), bag)
    scenes = load_scenes(bench.clean, bags, bench.detector, frame, chosen, bench.device)
    for bag in bags:
        bench.tidy(bag)
    titles = [f"{budget.attack} {budget.title}" for budget in map(budget_named, PANELS)]
    figure = draw_panels(scenes, titles, f"Recipe {recipe}, frame {frame}")
    return [ReportPicture(OVERVIEW, "", path.name, caption, to_png(figure))]
