"""The options of a sweep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from advpipe.pipeline.core import options
from advpipe.pipeline.core.options import check_bounds, option

if TYPE_CHECKING:
    from advpipe.pipeline.detector.adaptation import Adaptation

USUAL_FRAMES = 100
"""Without `frames`, at most so many, equally spaced over the bag."""


@dataclass(frozen=True)
class SweepOptions:
    """Which cells of a table, and how they are made and scored.

    table: whose budgets. cells: the names of some of them; empty for all. recipes: of the attacks. frames: of
    the clean bag; None for at most `USUAL_FRAMES`. seed: of the attacks, the baselines and the bootstrap.
    seeds: how many, from that one on. baseline_tries, detect_attacks: see `evaluate`. defences: too, but on
    all frames. keep_bags: whether to keep the adversarial bags, in bags/. workers: processes, by default one
    per core.
    """

    table: str = option(
        "paper",
        "Whose budgets: paper (all 18 of its Table II), or text (the shares that detach removes by its "
        "text: 0.7 %, not 0.05 %).",
    )
    recipes: tuple[str, ...] = option(
        ("best",),
        "Recipes of the attacks: best,hide,paper,random-best; best+half and best+twice take other steps; "
        "best+ray and best+order keep points on rays and in front, best+detections knows no "
        "true boxes; paper has λ = 0, paper+weighted λ = 0.01 (the paper gives λ no value).",
    )
    cells: tuple[str, ...] = option((), "Some budgets only: perturb-10,detach-1; repeatable.")
    frames: str | None = option(None, "start:stop:step.")
    detector: str = options.detector()
    device: str = options.device()
    seed: int = option(0, "Seed of the attacks, the baselines and the bootstrap.", least=0)
    seeds: int = option(1, "How many seeds, from --seed on; tables show the spread.", least=1)
    baseline_tries: int | None = options.baseline_tries()
    defences: tuple[str, ...] = option(
        ("none",),
        "Also score each cell under defences, on all frames: default, all, or NAME[:parameters] as for "
        "evaluate. Repeatable.",
    )
    detect_attacks: tuple[str, ...] = option(
        ("none",),
        "Also say whether these checks detect the attacks: all, or names as for evaluate. Repeatable.",
    )
    lidar_topic: str | None = options.lidar_topic()
    lidar_height_m: float | None = options.lidar_height_m()
    level: bool = options.level()
    scale_intensity: float = options.scale_intensity()
    keep_bags: bool = option(False, "Keep the adversarial bags that are made, in bags/.")
    workers: int | None = options.workers()

    def __post_init__(self) -> None:
        from advpipe.pipeline.attack_detection.registry import parse_attack_checks
        from advpipe.pipeline.defences.registry import parse_defences

        check_bounds(self)
        parse_defences(self.defences)
        parse_attack_checks(self.detect_attacks)
        _ = self.adaptation  # refuses what is out of bounds

    @property
    def adaptation(self) -> Adaptation:
        """How clouds are presented to the detector."""
        from advpipe.pipeline.detector.adaptation import Adaptation

        return Adaptation(self.lidar_height_m, self.level, self.scale_intensity)
