"""A cell's figures: the same rows as in the report of `advpipe evaluate`, without its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings
from advpipe.pipeline.core.code import source_commit
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.metrics.bootstrap import BlockBootstrap
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.condition import Arm
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.figures import ratio_draws
from advpipe.stages.evaluate.detection.scoring import known_classes
from advpipe.stages.evaluate.detection.summary import summarise

DRAWS = 1000


def scored_cell(
    clean: Path,
    bag: Path,
    budget: str,
    recipe: str,
    settings: Settings,
    *,
    detector: str,
    workers: int | None = None,
    device: str = CPU,
) -> Cell:
    """Score an adversarial bag of these settings beside the clean one and random baselines."""
    looking = DetectionRun(
        detector,
        clean,
        (bag,),
        (BagReader(bag).provenance,),
        settings.lidar_topic,
        settings.seed,
        baseline_tries=settings.baseline_tries,
        frames=FrameSlice.parse(settings.frames),
        device=device,
    )
    (comparison,) = looking.comparisons(workers)
    classes = known_classes(load_detector(detector, device))
    summary = summarise(comparison, classes, DRAWS, settings.seed)
    return Cell(
        budget,
        recipe,
        settings,
        summary.result,
        parent_sha256(bag),
        frames=tuple(frame.index for frame in comparison.frames),
        found_objects=tuple(each.clouds["clean"].found_objects for each in summary.per_frame),
        lost_objects=tuple(each.clouds["adv"].lost_objects for each in summary.per_frame),
        map_ratio_draws=_draws(
            comparison.frames, classes, summary.result.counts.classes_in_map, settings.seed
        ),
        commit=source_commit(),
    )


def _draws(
    frames: Sequence[FrameResult], classes: tuple[str, ...], in_map: Sequence[str], seed: int
) -> tuple[float | None, ...]:
    """The bootstrap draws of the mAP ratio, those that the row's interval comes of; empty without one.

    Cells of the same frames and seed draw the same blocks: their draws pair.
    """
    stamps_ns = np.array([frame.stamp_ns for frame in frames])
    bootstrap = BlockBootstrap.of(stamps_ns, DRAWS, named_generator(seed, "evaluate", "bootstrap"))
    clean, attacked = (Arm.of(frames, word, classes, in_map, bootstrap) for word in ("clean", "adv"))
    draws = ratio_draws(attacked, clean)
    return tuple(float(f"{draw:.6g}") if np.isfinite(draw) else None for draw in draws)
