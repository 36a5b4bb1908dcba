"""Cells of a sweep, written by hand."""

from dataclasses import replace

from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings
from advpipe.pipeline.results.metrics import (
    BaselineMetrics,
    CleanMeans,
    CleanMetrics,
    CloudMetrics,
    Precisions,
    RecountedMetrics,
)
from advpipe.pipeline.results.row import AttackRecord, FrameCounts, ResultRow

SETTINGS = Settings("a" * 64, "small", "b" * 64, "0::2", 0, 5, None, "0.1.0", "d" * 64)

NO_PRECISIONS = Precisions({}, {})


def figures(ratio, distance=0.001):
    return CloudMetrics(
        map_adv=ratio / 100,
        map_adv_ci95=None,
        map_ratio_percent=ratio,
        map_ratio_ci95=(ratio - 1, ratio + 1),
        map_loose_adv=0.5,
        map_loose_ratio_percent=ratio + 30,
        map_bev_adv=0.5,
        map_bev_loose_adv=0.5,
        chamfer_distance_m2=distance,
        attack_success_percent=10.0,
        mean_displacement_m=0.01,
        rms_displacement_m=0.0123,
        median_displacement_m=0.01,
        p95_displacement_m=0.05,
        max_displacement_m=0.0999,
        max_added_m=0.0,
        points_added=0,
        points_removed=0,
        points_moved=50,
        objects_below_min_points=0,
        found_objects=3,
        false_positives=0,
        lost_objects=0,
        new_false_positives=0,
        precisions=NO_PRECISIONS,
        map_loose_ratio_ci95=(ratio + 27.5, ratio + 32.5),
    )


def baseline(ratio, of, distance):
    drawn = replace(
        figures(ratio, distance), map_ratio_ci95=None, map_loose_ratio_percent=97.0, map_loose_ratio_ci95=None
    )
    return BaselineMetrics(drawn, of - ratio, (-60.0, -40.0), True)


def cell(
    budget,
    ratio,
    recipe="best",
    distance=0.001,
    draws=(),
    lost=(0, 0, 0),
    found=(3, 3, 3),
    random=90.0,
    name="random_best",
):
    baselines = {} if random is None else {name: baseline(random, ratio, 2 * distance)}
    criteria = ("strict", "loose", "bev", "bev_loose")
    row = ResultRow(
        bag=f"{recipe}-{budget}",
        detector="small",
        attack=AttackRecord(budget.partition("-")[0], recipe, None, None, {}, "small", True, 24, 5),
        counts=FrameCounts(3, 3, ("car",), 0.25, 9, 9, 0, 1000),
        boxes={"car": 9},
        clean=CleanMetrics({each: CleanMeans(0.9, None, 0.9) for each in criteria}, NO_PRECISIONS),
        attacked=figures(ratio, distance),
        recounted=RecountedMetrics(9, ratio / 100, ratio, None, 0, 0.0),
        baselines=baselines,
        significant_vs_random=True if baselines else None,
        notes=(),
    )
    return Cell(budget, recipe, SETTINGS, row, "c" * 64, (0, 2, 4), found, lost, draws)
