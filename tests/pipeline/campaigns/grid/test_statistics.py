"""Ratios over drives and their intervals."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

sys.path.insert(0, str(Path(__file__).parent))

from grids import finished, write_grid_file

from advpipe.pipeline.campaigns.grid.statistics import DriveRatio, expanded_levels, groups_of_cells


def test_the_ratio_is_that_of_the_means() -> None:
    ratio = DriveRatio.of(np.array([0.2, 0.0, 0.1]), np.array([0.8, 0.2, 0.5]))
    assert ratio.percent == pytest.approx(20)
    assert ratio.ci95 is not None
    assert 0 <= ratio.ci95[0] < 20 < ratio.ci95[1] <= 25


def test_equal_drives_leave_no_doubt() -> None:
    assert DriveRatio.of(np.full(4, 0.3), np.full(4, 0.6)) == DriveRatio(pytest.approx(50), (50.0, 50.0))  # type: ignore[arg-type]


@pytest.mark.parametrize("drives", [0, 1, 2])
def test_few_drives_have_no_interval(drives: int) -> None:
    ratio = DriveRatio.of(np.full(drives, 0.3), np.full(drives, 0.6))
    assert ratio.ci95 is None
    assert math.isnan(ratio.percent) == (drives == 0)


def test_a_ratio_to_hardly_anything_is_none() -> None:
    ratio = DriveRatio.of(np.full(5, 0.01), np.full(5, 0.02))
    assert math.isnan(ratio.percent)
    assert ratio.ci95 is None


def test_drives_in_which_nothing_is_found_leave_no_interval_where_they_may_be_drawn_alone() -> None:
    few = DriveRatio.of(np.array([0.3, 0.4, 0.3]), np.array([0.6, 0.0, 0.4]))
    assert few == DriveRatio(pytest.approx(100), None)  # type: ignore[arg-type]
    many = DriveRatio.of(np.array([0.3] * 9 + [0.0]), np.array([0.6] * 9 + [0.0]))
    assert many == DriveRatio(pytest.approx(50), (pytest.approx(50), pytest.approx(50)))  # type: ignore[arg-type]


def test_the_interval_is_as_wide_as_that_of_student() -> None:
    """Of a mean of 20 normal drives, whose exact interval is Student's."""
    part = np.random.default_rng(3).normal(0.5, 0.1, 20)
    ratio = DriveRatio.of(part, np.ones(20))
    assert ratio.ci95 is not None
    exact = 100 * t.ppf(0.975, 19) * part.std(ddof=1) / math.sqrt(20)
    assert ratio.ci95[1] - ratio.ci95[0] == pytest.approx(2 * exact, rel=0.05)
    low, high = expanded_levels(20)
    assert 0 < low < 0.025
    assert low == pytest.approx(1 - high)


def test_cells_that_differ_in_their_seed_are_one_group(tmp_path: Path) -> None:
    path = write_grid_file(
        tmp_path, factors={"traffic.vehicles": [10, 20]}, seeds=[1, 2, 3], defences=["none", "jitter:0.02"]
    )
    _, cells = finished(path, tmp_path)
    groups = groups_of_cells(cells)
    assert [(group.key[0], group.key[3], group.seeds) for group in groups] == [
        ((vehicles,), defence, (1, 2, 3)) for vehicles in (10, 20) for defence in ("none", "jitter:0.02")
    ]
    plain, defended = groups[:2]
    assert plain.ratio().percent == pytest.approx(30)
    assert plain.ratio(of_baseline=True).percent == pytest.approx(75)
    assert plain.delta().percent == pytest.approx(-45)
    assert plain.ratio("0-30 m").percent == pytest.approx(50)
    assert defended.ratio().percent == pytest.approx(15)
    assert math.isnan(defended.ratio("0-30 m").percent)
