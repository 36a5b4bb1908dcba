"""Runs the cells of a sweep."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.budgets import AXES, SweepBudget
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings, Times
from advpipe.pipeline.campaigns.sweep.scored import scored_cells
from advpipe.pipeline.campaigns.sweep.variants import split_recipe, steps_factor, variant_parameters
from advpipe.pipeline.core.errors import writing
from advpipe.pipeline.core.partial import remove_output
from advpipe.pipeline.core.progress import plan_progress, working_on
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.provenance import job_provenance, resolved_text
from advpipe.stages.attack.run import AttackRequest, attack


@dataclass(frozen=True)
class Bench:
    """Runs cells: stage 2 makes a bag, stage 3 scores it, and it is removed unless `keep_bags`."""

    clean: Path
    out: Path
    detector: str
    workers: int | None
    keep_bags: bool = False
    device: str = CPU

    def request(self, budget: SweepBudget, recipe: str, settings: Settings) -> AttackRequest:
        """The attack of a budget, by a recipe and its variants."""
        base, _ = split_recipe(recipe)
        parameters = {**budget.parameters, **(variant_parameters(recipe, budget.attack) or {})}
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
                "lidar_height_m": settings.lidar_height_m,
                "level": settings.level,
                "scale_intensity": settings.scale_intensity,
            }
        )
        return AttackRequest((spec,), settings.seed, self.device, debug=False)

    def attack(self, budget: SweepBudget, recipe: str, settings: Settings, bag: Path) -> None:
        """Make the bag of a budget; a bag that a killed run has finished is kept."""
        request, made = self.request(budget, recipe, settings), bag / "attack.yaml"
        if made.is_file():
            wanted = resolved_text(job_provenance(BagReader(self.clean), request))
            if made.read_text(encoding="utf-8") == wanted:
                return
        with writing(bag):
            attack(self.clean, bag, request, overwrite=bag.exists(), workers=self.workers)

    def run(
        self, budget: SweepBudget, recipes: Sequence[str], settings: Settings
    ) -> Iterator[tuple[Cell, Times]]:
        """Attack and evaluate the cells of some recipes; also the time that each took.

        They are evaluated together, which takes less time than one by one: they share what is found in clean
        clouds, and random-best where they spend as much, with the same goal, constraints and number of tries.
        """
        bags = {recipe: self.out / "bags" / f"{recipe}-{budget.name}" for recipe in recipes}
        plan_progress({**{f"attacking: {recipe}": 2 for recipe in recipes}, "evaluating": len(recipes)})
        attack_s = {}
        for recipe, bag in bags.items():
            begin_s = time.perf_counter()
            with working_on(f"attacking: {recipe}"):
                self.attack(budget, recipe, settings, bag)
            attack_s[recipe] = round(time.perf_counter() - begin_s, 1)
        begin_s = time.perf_counter()
        with working_on("evaluating"):
            cells = scored_cells(
                self.clean,
                bags,
                budget.name,
                settings,
                detector=self.detector,
                workers=self.workers,
                device=self.device,
            )
        share_s = round((time.perf_counter() - begin_s) / len(cells), 1)
        for cell in cells:
            if not self.keep_bags:
                self.tidy(bags[cell.recipe])
            yield cell, Times(attack_s[cell.recipe], share_s)

    def tidy(self, folder: Path) -> None:
        """Remove a bag, and its parent folder if that is empty then."""
        remove_output(folder)
        if folder.parent.is_dir() and not any(folder.parent.iterdir()):
            folder.parent.rmdir()
