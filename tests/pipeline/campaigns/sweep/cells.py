"""Cells of a sweep, written by hand."""

from advpipe.pipeline.campaigns.sweep.cell import Cell, Settings

SETTINGS = Settings("a" * 64, "small", "b" * 64, "0::2", 0, 5, None, "0.1.0", "d" * 64)


def cell(
    budget, ratio, recipe="best", distance=0.001, draws=(), lost=(0, 0, 0), found=(3, 3, 3), random=90.0
):
    baselines = [] if random is None else ["baseline"]
    row = {
        "map_ratio_percent": ratio,
        "map_ratio_ci95": (ratio - 1, ratio + 1),
        "chamfer_distance_m2": distance,
        "baselines": baselines,
        "baseline_map_ratio_percent": random,
        "baseline_map_ratio_ci95": None,
        "baseline_chamfer_distance_m2": 2 * distance,
        "map_ratio_minus_baseline": None if random is None else ratio - random,
        "map_ratio_minus_baseline_ci95": (-60.0, -40.0),
        "beats_baseline": True,
        "beats_random": None if random is None else True,
        "max_displacement_m": 0.0999,
        "rms_displacement_m": 0.0123,
        "max_added_m": 0.0,
        "points_clean": 1000,
        "points_removed": 0,
        "points_added": 0,
        "points_moved": 50,
        "frames": 3,
        "looks": 24,
        "baseline_tries": 5,
        "map_loose_ratio_percent": ratio + 30,
        "working_score": 0.25,
        "baseline_map_loose_ratio_percent": 97.0,
    }
    return Cell(budget, recipe, SETTINGS, row, "c" * 64, (0, 2, 4), found, lost, draws)
