"""What a sweep is asked to do."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.detector.device import CPU

USUAL_FRAMES = 100
"""Of a sweep that names none: at most so many, equally spaced over the bag."""


@dataclass(frozen=True)
class SweepOptions:
    """Which cells of a table, and how they are made and scored.

    table: whose budgets; cells: some of them only, by name. recipes: of the attacks. frames: of the clean
    bag; None for at most `USUAL_FRAMES`. seed: of the attacks, the baselines and the
    bootstrap. baseline_tries: see `evaluate`. keep_bags: the adversarial bags stay, in bags/. workers:
    processes, by default one a core.
    """

    table: str = "paper"
    recipes: tuple[str, ...] = ("best",)
    cells: tuple[str, ...] = ()
    frames: str | None = None
    detector: str = "small"
    device: str = CPU
    seed: int = 0
    baseline_tries: int | None = None
    lidar_topic: str | None = None
    keep_bags: bool = False
    workers: int | None = None
