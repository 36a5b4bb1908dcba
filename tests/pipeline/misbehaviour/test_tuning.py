"""Thresholds from streams made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.tuning import Stream, clean_thresholds, tune, tune_catch

Make = Callable[..., Claim]


def stream(make: Make, ego: ReceivingVehicle, false_from_s: float | None = None, seed: int = 0) -> Stream:
    """Three cars in lanes of their own, whose positions err by 0.1 m; false ones are 40 m ahead."""
    rng = np.random.default_rng(seed)
    claims, is_false = [], []
    for nth in range(30):
        for station in (7, 8, 9):
            time_s, is_false_now = (
                0.4 * nth + 0.1 * station,
                false_from_s is not None and 0.4 * nth >= false_from_s,
            )
            x_m = 10 * time_s + rng.normal(0, 0.1) + (40.0 if is_false_now and station == 9 else 0.0)
            claims.append(make(time_s, station_id=station, x_m=x_m, y_m=10.0 * station))
            is_false.append(is_false_now and station == 9)
    return Stream(claims, [ego] * len(claims), np.array(is_false), "offset" if false_from_s else "")


def test_thresholds_are_what_honest_messages_reach_times_the_margin(
    make: Make, ego: ReceivingVehicle
) -> None:
    """The farthest is station 9 at its end: 12.5 s at 10 m/s, and 90 m to the side."""
    base = DetectorConfig()
    found = clean_thresholds([stream(make, ego)], 0.0, base)
    farthest_m = max(np.hypot(c.x_m - ego.x_m, c.y_m - ego.y_m) for c in stream(make, ego).claims)
    assert farthest_m * CHECKS["range"].margin < CHECKS["range"].least == found["range"]
    assert found["speed"] == CHECKS["speed"].least
    assert found["frequency"] == CHECKS["frequency"].rule  # follows from the rules of CAMs
    assert found["position"] == base.thresholds["position"]  # no roads: nothing to learn from


def test_the_more_may_be_above_the_lower(make: Make, ego: ReceivingVehicle) -> None:
    base = DetectorConfig()
    strict = clean_thresholds([stream(make, ego)], 0.2, base)
    lenient = clean_thresholds([stream(make, ego)], 0.0, base)
    assert strict["kalman"] <= lenient["kalman"]
    assert all(strict[name] <= lenient[name] for name in CHECKS)


def test_tuned_on_one_drive_it_detects_false_messages_on_another(make: Make, ego: ReceivingVehicle) -> None:
    clean, attacked = stream(make, ego), stream(make, ego, 6.0, seed=1)
    found = tune([clean], [attacked])
    assert found.false_positive_rate == 0.0
    assert found.mean_f1 == pytest.approx(1.0)


def test_where_no_setting_is_within_the_bound(make: Make, ego: ReceivingVehicle) -> None:
    bad = stream(make, ego)
    broken = replace(bad, claims=[one._replace(invalid=1) for one in bad.claims])
    with pytest.raises(ValueError, match="no setting flags less than"):
        tune([broken], [])


def test_the_baseline_is_the_same_again(make: Make, ego: ReceivingVehicle) -> None:
    clean, attacked = stream(make, ego), stream(make, ego, 6.0, seed=1)
    one, other = (tune_catch([clean], [attacked], seed=3) for _ in range(2))
    assert one == other
    assert one.false_positive_rate <= 0.005
    assert one.mean_f1 > 0
