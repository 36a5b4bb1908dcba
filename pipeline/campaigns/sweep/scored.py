"""Cells' metrics: the same rows as in the report of `advpipe evaluate`, without its pictures."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings
from advpipe.pipeline.campaigns.sweep.listed import listed_results
from advpipe.pipeline.core.code import source_commit
from advpipe.pipeline.core.progress import plan_progress
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.defences.registry import NONE
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.metrics.bootstrap import BlockBootstrap
from advpipe.pipeline.results.row import RANDOM_BEST
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.condition_matches import ConditionMatches
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.metrics import ratio_draws
from advpipe.stages.evaluate.detection.summary import summarise
from advpipe.stages.evaluate.options import Options

DRAWS = 1000


def scored_cells(
    clean: Path,
    bags: Mapping[str, Path],
    budget: str,
    settings: Settings,
    *,
    detector: str,
    workers: int | None = None,
    device: str = CPU,
) -> list[Cell]:
    """Score adversarial bags of these settings, by recipe, beside the clean one and random baselines."""
    run = DetectionRun(
        detector,
        clean,
        {bag: BagReader(bag).provenance for bag in bags.values()},
        Options(
            detectors=(detector,),
            seed=settings.seed,
            baseline_tries=settings.baseline_tries,
            defences=settings.defences or (NONE,),
            defence_frames=sys.maxsize,
            frames=FrameSlice.parse(settings.frames),
            lidar_topic=settings.lidar_topic,
            lidar_height_m=settings.lidar_height_m,
            level=settings.level,
            scale_intensity=settings.scale_intensity,
            device=device,
            detect_attacks=settings.detect_attacks or (NONE,),
        ),
    )
    plan_progress({"detecting": 9, "metrics": 1})
    comparisons = run.comparisons(workers)
    return [
        _cell(recipe, budget, bag, settings, comparison)
        for (recipe, bag), comparison in zip(bags.items(), comparisons, strict=True)
    ]


def _cell(recipe: str, budget: str, bag: Path, settings: Settings, comparison: Comparison) -> Cell:
    summary = summarise(comparison, DRAWS, settings.seed)
    draws = dict(_draws(comparison, summary.result.counts.classes_in_map, settings.seed))
    return Cell(
        budget,
        recipe,
        settings,
        summary.result,
        parent_sha256(bag),
        frames=tuple(frame.index for frame in comparison.frames),
        found_objects=tuple(each.clouds["clean"].found_objects for each in summary.per_frame),
        lost_objects=tuple(each.clouds["adv"].lost_objects for each in summary.per_frame),
        map_ratio_draws=draws.pop("strict"),
        other_draws=draws,
        listed=listed_results(summary),
        commit=source_commit(),
    )


def _draws(
    comparison: Comparison, in_map: Sequence[str], seed: int
) -> Iterator[tuple[str, tuple[float | None, ...]]]:
    """The bootstrap draws of the mAP ratio of the attack and of the baseline to beat, strict and loose, by
    `draws_name`; empty without an interval.

    Cells of the same frames and seed draw the same blocks: their draws pair.
    """
    frames, classes = comparison.frames, comparison.classes
    stamps_ns = np.array([frame.stamp_ns for frame in frames])
    bootstrap = BlockBootstrap.of(stamps_ns, DRAWS, named_generator(seed, "evaluate", "bootstrap"))
    conditions = [
        name for name in ("clean", "adv", RANDOM_BEST) if all(name in frame.clouds() for frame in frames)
    ]
    clean, *others = (
        ConditionMatches.of(frames, condition, classes, in_map, bootstrap) for condition in conditions
    )
    for condition, found in zip(conditions[1:], others, strict=True):
        for criterion in ("strict", "loose"):
            draws = ratio_draws(found, clean, criterion)
            kept = tuple(float(f"{draw:.6g}") if np.isfinite(draw) else None for draw in draws)
            yield draws_name(condition, criterion), kept


def draws_name(condition: str, criterion: str) -> str:
    """Such as `random_best_loose`; `strict` for the attack itself at strict overlap.

    >>> draws_name("adv", "loose")
    'loose'
    """
    parts = ([] if condition == "adv" else [condition]) + ([] if criterion == "strict" else [criterion])
    return "_".join(parts) or "strict"
