"""Scores the cells of one adversarial bag and detector: one detection run for all defences together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.grid.cell import WHOLE, GridValues
from advpipe.pipeline.campaigns.grid.models import UNDEFENDED, GridFile
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.metrics import Interval
from advpipe.pipeline.results.row import ResultRow
from advpipe.stages.evaluate.detection.condition_matches import Precision
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.strata import STRATA
from advpipe.stages.evaluate.detection.summary import Summary, summarise
from advpipe.stages.evaluate.options import Options

GRID_DRAWS = 1000
RANGES = tuple(stratum.name for stratum in STRATA if stratum.by == "range")


@dataclass(frozen=True)
class ScoredBag:
    """The summary of an adversarial bag, as one detector sees it."""

    row: ResultRow
    values: dict[str, tuple[GridValues, ...]]
    """By defence, as the grid names it, the figures of each stratum."""


def score_bag(
    clean: Path,
    bag: Path,
    detector: str,
    defences: Sequence[str],
    grid: GridFile,
    seed: int,
    *,
    device: str,
    workers: int | None,
) -> ScoredBag:
    """Score a bag under these defences (`none` for without one) beside the clean bag and random baselines."""
    named = {text: next(iter(parse_defences((text,)))) for text in defences if text != UNDEFENDED}
    run = DetectionRun(
        detector,
        clean,
        {bag: BagReader(bag).provenance},
        Options(
            detectors=(detector,),
            seed=seed,
            baseline_tries=grid.baseline_tries,
            defences=tuple(named) or (UNDEFENDED,),
            frames=FrameSlice.parse(grid.frames),
            lidar_topic=grid.lidar,
            device=device,
            detect_attacks=("none",),
        ),
    )
    (comparison,) = run.comparisons(workers)
    summary = summarise(comparison, GRID_DRAWS, seed)
    values = {}
    for text in defences:
        found = _undefended(summary) if text == UNDEFENDED else _defended(summary, named[text])
        values[text] = tuple(found)
    return ScoredBag(summary.result, values)


def _undefended(summary: Summary) -> Iterator[GridValues]:
    """The figures of all objects, and the mAP of those in each range of distances."""
    row = summary.result
    attacked, name = row.attacked, row.strongest_baseline
    assert attacked is not None
    low, high = attacked.map_ratio_ci95 or (math.nan, math.nan)
    yield _values(
        stratum=WHOLE,
        objects=row.counts.objects,
        frames=row.counts.frames,
        map_clean=row.clean.means["strict"].map_r40,
        map_adv=attacked.map_adv,
        map_baseline=row.baselines[name].metrics.map_adv if name else None,
        baseline=name,
        map_ratio_percent=attacked.map_ratio_percent,
        map_ratio_low_percent=low,
        map_ratio_high_percent=high,
        attack_success_percent=attacked.attack_success_percent,
        chamfer_distance_m2=attacked.chamfer_distance_m2,
        points_removed=attacked.points_removed,
        points_added=attacked.points_added,
        points_moved=attacked.points_moved,
    )
    for stratum in RANGES:
        clean, adversarial = (
            _in_stratum(summary.precisions[condition], stratum, row.counts.classes_in_map)
            for condition in ("clean", "adv")
        )
        yield _values(
            stratum=stratum,
            objects=sum(each.boxes for each in clean),
            frames=row.counts.frames,
            map_clean=_mean([each.ap_r40 for each in clean]),
            map_adv=_mean([each.ap_r40 for each in adversarial]),
        )


def _defended(summary: Summary, defence: str) -> Iterator[GridValues]:
    """The figures of all objects under a defence, of all frames."""
    (record,) = (each for each in summary.defended if each.defence == defence)
    attacked, random = record.attacked, record.baseline
    assert attacked is not None
    bounds: Interval = attacked.map_ratio_ci95
    low, high = bounds or (math.nan, math.nan)
    yield _values(
        stratum=WHOLE,
        objects=summary.result.counts.objects,
        frames=record.frames,
        map_clean=record.map_clean,
        map_adv=attacked.map_adv,
        map_baseline=random.random_best_map_adv if random else None,
        baseline="random_best" if random else None,
        map_ratio_percent=attacked.map_ratio_percent,
        map_ratio_low_percent=low,
        map_ratio_high_percent=high,
    )


def _in_stratum(found: Sequence[Precision], stratum: str, in_map: Sequence[str]) -> list[Precision]:
    """The strict precisions of the classes of the mAP that have objects in a range."""
    return [
        each
        for each in found
        if (each.by, each.stratum, each.criterion) == ("range", stratum, "strict")
        and each.name in in_map
        and each.boxes
    ]


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else math.nan


def _values(**values: object) -> GridValues:
    plain = plain_value(values)
    return GridValues.model_validate(plain)
