"""Ten steps of a vehicle that drives north, with errors that add up by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.localisation.monitor import nis_threshold, windowed_alarms
from advpipe.stages.evaluate.localisation.metrics import errors, localisation_record, was_attacked
from advpipe.stages.evaluate.localisation.track import LocalisationTrack

TIMES_NS = 7_000_000_000 + 100_000_000 * np.arange(10)
TRUE_M = np.column_stack([np.zeros(10), np.arange(10.0), np.zeros(10)])


def track(error_m=0.0, nis=3.0) -> LocalisationTrack:
    ahead = np.tile([0.0, 1.0, 0.0], (10, 1))
    return LocalisationTrack(
        TIMES_NS, TRUE_M, ahead, TRUE_M, TRUE_M + error_m, np.broadcast_to(nis, 10).astype(float)
    )


def test_the_threshold_is_that_of_the_tables():
    assert nis_threshold() == pytest.approx(16.266, abs=1e-3)


def test_the_windowed_test_adds_up_what_single_fixes_hide():
    """The 99.9 % quantile of three fixes is 27.877 (9 degrees of freedom), so 10 each are too much from the
    third on; a missing fix is passed over, and an honest one at the end ends the alarm."""
    assert nis_threshold(3) == pytest.approx(27.877, abs=1e-3)
    nis = np.array([10, 10, np.nan, 10, 10, 3, 3.0])
    assert not (nis > nis_threshold()).any()
    found = windowed_alarms(nis, 3)
    assert found.tolist() == [False, False, False, True, True, False, False]


def test_errors_by_hand():
    """3 m to the west, 4 ahead and 12 up at one step, nothing at another: 5 m in the plane, 13 m in all."""
    error_m = np.zeros((10, 3))
    error_m[4] = -3, 4, 12
    chosen = np.isin(np.arange(10), (4, 5))
    found = errors(track(error_m), chosen)
    assert found.mean_m == pytest.approx(2.5)
    assert found.rmse_m == pytest.approx(5 / math.sqrt(2))
    assert found.max_m == pytest.approx(5)
    assert found.ate_m == pytest.approx(13 / math.sqrt(2))
    assert found.lateral_mean_m == pytest.approx(1.5)
    assert found.lateral_max_m == pytest.approx(3)
    assert track(error_m).lateral_m[4] == pytest.approx(3)  # west is to the left of north
    assert math.isnan(errors(track(), np.zeros(10, dtype=bool)).mean_m)


def test_a_bias_is_not_aligned_away():
    assert errors(track(np.tile([30.0, 40.0, 0.0], (10, 1))), np.ones(10, dtype=bool)).ate_m == 50


def test_detection_by_hand():
    """Fixes 3 to 6 are attacked; of these one is lost, 5 fails the test; 7 is genuine and fails; 0 in the
    clean bag, too. The estimate is 6 m off at steps 5 and 6, two of four."""
    nis = np.full(10, 3.0)
    nis[[5, 7]] = 20
    nis[6] = np.nan
    error_m = np.zeros((10, 3))
    error_m[5:7, 0] = 6
    clean_nis = np.full(10, 3.0)
    clean_nis[0] = 17
    row = localisation_record("b", "ego", track(nis=clean_nis), track(error_m, nis), TIMES_NS[3:7])
    assert (row.fixes, row.attacked, row.lost) == (10, 4, 1)
    assert row.span_s == pytest.approx(0.3)
    assert row.detection_rate == pytest.approx(1 / 3)
    assert row.stealth_rate == pytest.approx(2 / 3)
    assert row.delay_s == pytest.approx(0.2)
    assert row.false_alarm_rate == pytest.approx(0.1)
    assert row.echo_rate == pytest.approx(1 / 3)  # of steps 7, 8 and 9
    assert row.success_rate == pytest.approx(0.5)
    assert (row.window_detection_rate, row.window_false_alarm_rate) == (0, 1 / 10)
    assert math.isnan(row.window_delay_s)
    assert row.clean.mean_m == 0
    assert row.adversarial.mean_m == pytest.approx(3)
    assert row.ate_m == pytest.approx(6 * math.sqrt(0.2))


def test_nothing_is_noticed_where_all_is_lost():
    jammed = replace(track(), nis=np.full(10, np.nan))
    row = localisation_record("b", "ego", track(), jammed, TIMES_NS)
    assert row.lost == 10
    assert math.isnan(row.detection_rate)
    assert math.isnan(row.delay_s)


def test_a_fix_counts_for_the_estimate_after_it():
    assert np.nonzero(was_attacked(track(), TIMES_NS[[2, 4]] - 50_000_000))[0].tolist() == [2, 4]
