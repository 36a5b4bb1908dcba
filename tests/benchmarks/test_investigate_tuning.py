"""The tuning of investigations: limits and weights from readings that a person can check."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import numpy as np
import pytest
from benchmark_modules import benchmark_module

from advpipe.stages.investigate.cue import CueReading, Suspect, station

LIDAR = Suspect("/ego/lidar/points")
S = 1_000_000_000


@pytest.fixture(scope="module")
def tuning() -> Iterator[ModuleType]:
    with benchmark_module("investigate_tuning") as module:
        yield module


def readings(cue: str, who: Suspect, values: np.ndarray, from_s: float = 0.0) -> list[tuple[str, CueReading]]:
    return [
        (cue, CueReading(who, round((from_s + number / 10) * S), float(value), "words"))
        for number, value in enumerate(values)
    ]


def least(**changed: float) -> dict[str, float]:
    from advpipe.stages.investigate.registry import CUES

    return dict.fromkeys(CUES, 1.0) | {name.replace("_", "-"): value for name, value in changed.items()}


@pytest.fixture(scope="module")
def bags(tuning: ModuleType) -> list[object]:
    """Clean drives in which a cue reads 1 to 3, and as many in which a station is read at 30 from 8 s on."""
    from investigate_drives import TrueLie

    rng = np.random.default_rng(3)
    found: list[object] = []
    for number in range(24):
        usual = [
            one
            for who in range(4)
            for one in readings("free-space", station(who), rng.uniform(1.0, 3.0, 150))
        ]
        lies = []
        if number % 2:
            usual += readings("free-space", station(9), np.full(60, 30.0), from_s=8.0)
            lies = [TrueLie(station(9), "cam-ghost-stop", 8 * S, 14 * S)]
        found.append((usual, lies))
    return found


def test_a_limit_is_above_what_honest_ones_reach_for_long(tuning: ModuleType, bags: list[object]) -> None:
    found = tuning.tuned(bags, least())
    assert 2.0 < found.cues["free-space"].limit < 6.0
    assert found.cues["gnss-lanes"].limit == 1.0  # of which nothing was read: the least


def test_who_lies_gets_a_high_probability_and_who_does_not_a_low_one(
    tuning: ModuleType, bags: list[object]
) -> None:
    found = tuning.tuned(bags, least())
    assert found.probability({"free-space": 8.0}) > 0.9
    assert found.probability({"free-space": 0.0}) < 0.05
    assert found.alarm_probability == 0.5


def test_a_cue_that_no_drive_needs_keeps_its_prior_weight(tuning: ModuleType) -> None:
    scores, lied = np.zeros((100, 2)), np.arange(100) % 2 == 0
    scores[lied, 0] = 5.0
    weights, _ = tuning.logistic(scores, lied, np.ones(100))
    assert weights[1] == pytest.approx(tuning.PRIOR_WEIGHT, abs=1e-3)
    assert weights[0] > 0


def test_platts_line_mends_odds_that_are_too_sure(tuning: ModuleType) -> None:
    """Of those with odds of 4, three of four lied, whose log odds are ln 3."""
    odds = np.repeat([4.0, -4.0], 400)
    lied = np.r_[np.arange(400) % 4 > 0, np.arange(400) % 4 == 0]
    slope, offset = tuning.platt(odds, lied, np.ones(800))
    assert slope * 4 + offset == pytest.approx(np.log(3), abs=0.05)


def test_units_are_suspects_in_windows(tuning: ModuleType) -> None:
    from investigate_drives import TrueLie

    calibration = tuning.Calibration(
        {name: tuning.CueCalibration(1.0, 1.0) for name in tuning.CUES}, intercept=-5.0
    )
    series = readings("lidar-rays", LIDAR, np.r_[np.zeros(160), np.full(20, 9.0)])
    found = tuning.units([(series, [TrueLie(LIDAR, "perturb", 16 * S, 17 * S)])], calibration)
    assert found.lied.tolist() == [False, True]
    at = list(tuning.CUES).index("lidar-rays")
    assert found.scores[0, at] == 0.0
    assert found.scores[1, at] == pytest.approx(calibration.ceiling, abs=0.5)
