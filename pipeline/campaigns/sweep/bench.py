"""Runs the cells of a sweep."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.budgets import AXES, SweepBudget
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings, Times
from advpipe.pipeline.campaigns.sweep.scored import scored_cell
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

    def run(self, budget: SweepBudget, recipe: str, settings: Settings) -> tuple[Cell, Times]:
        """Attack and evaluate one cell; also the time that each took."""
        bag = self.out / "bags" / f"{recipe}-{budget.name}"
        begin_s = time.perf_counter()
        plan_progress({"attacking": 2, "evaluating": 1})
        with working_on("attacking"):
            self.attack(budget, recipe, settings, bag)
        attacked_s = time.perf_counter()
        with working_on("evaluating"):
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
        """Remove a bag, and its parent folder if that is empty then."""
        remove_output(folder)
        if folder.parent.is_dir() and not any(folder.parent.iterdir()):
            folder.parent.rmdir()
