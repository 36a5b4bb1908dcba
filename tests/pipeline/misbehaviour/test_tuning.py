"""Thresholds from streams made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.misbehaviour import catch_tuning
from advpipe.pipeline.misbehaviour.catch_tuning import tune_catch
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.tuning import (
    MAX_FALSE_POSITIVE_RATE,
    WORST_STREAM,
    Stream,
    TuningScore,
    evaluated,
    threshold_candidates,
    tune,
)

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


def test_candidates_are_what_honest_messages_reach(make: Make, ego: ReceivingVehicle) -> None:
    """The farthest is station 9 at its end: 12.5 s at 10 m/s, and 90 m to the side."""
    base = DetectorConfig()
    found = threshold_candidates([stream(make, ego)], base)
    farthest_m = max(np.hypot(c.x_m - ego.x_m, c.y_m - ego.y_m) for c in stream(make, ego).claims)
    assert farthest_m * CHECKS["range"].margin < CHECKS["range"].least == found["range"][0]
    assert found["speed"] == (CHECKS["speed"].least,)
    assert "frequency" not in found  # follows from the rules of CAMs
    assert found["position"] == (base.thresholds["position"],)  # no roads: nothing to learn from
    assert all(list(levels) == sorted(levels, reverse=True) for levels in found.values())


def test_pardon_times_are_chosen_each_by_itself() -> None:
    def evaluate(config: DetectorConfig) -> TuningScore:
        return TuningScore((config.pardon_s == 3.0) + (config.acceleration_pardon_s == 10.0) / 2, 0.0)

    found = tune({}, evaluate).config
    assert (found.pardon_s, found.acceleration_pardon_s) == (3.0, 10.0)


def test_tuned_on_one_drive_it_detects_false_messages_on_another(make: Make, ego: ReceivingVehicle) -> None:
    clean, attacked = stream(make, ego), stream(make, ego, 6.0, seed=1)
    candidates = threshold_candidates([clean], DetectorConfig())
    found = tune(candidates, evaluated([clean, attacked]))
    assert found.score.false_positive_rate == 0.0
    assert found.score.mean_f1 == pytest.approx(1.0)


def test_each_threshold_is_chosen_by_itself() -> None:
    """The best of both checks, which no common share of honest messages gives; and the bound is kept."""
    candidates = {"drift": (9.0, 8.0, 7.0, 6.0), "kalman": (90.0, 80.0, 70.0, 60.0)}

    def evaluate(config: DetectorConfig) -> TuningScore:
        drift, kalman = config.thresholds["drift"], config.thresholds["kalman"]
        f1 = 0.9 - abs(drift - 6.0) / 10 - abs(kalman - 90.0) / 100
        return TuningScore(f1, 0.01 if drift < 7.0 else 0.001)

    found = tune(candidates, evaluate)
    assert (found.config.thresholds["drift"], found.config.thresholds["kalman"]) == (7.0, 90.0)
    assert found.score.false_positive_rate <= MAX_FALSE_POSITIVE_RATE


def test_where_no_setting_is_within_the_bound(make: Make, ego: ReceivingVehicle) -> None:
    bad = stream(make, ego)
    broken = replace(bad, claims=[one._replace(invalid=1) for one in bad.claims])
    candidates = threshold_candidates([broken], DetectorConfig())
    with pytest.raises(ValueError, match="no setting flags less than"):
        tune(candidates, evaluated([broken]))


def test_the_worst_receiver_does_not_hide_behind_the_others(make: Make, ego: ReceivingVehicle) -> None:
    """All of one stream's messages are flagged, a third of all; beyond the bound, no attack is looked at."""
    good, attacked = stream(make, ego), stream(make, ego, 6.0, seed=1)
    broken = replace(good, claims=[one._replace(invalid=1) for one in good.claims])
    found = evaluated([good, broken, good, attacked])(DetectorConfig())
    assert found == TuningScore(0.0, pytest.approx(1 / WORST_STREAM))


def test_the_baseline_is_the_same_again(
    make: Make, ego: ReceivingVehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(catch_tuning, "DRAWS", 20)
    monkeypatch.setattr(catch_tuning, "REFINEMENTS", 10)
    streams = [stream(make, ego), stream(make, ego, 6.0, seed=1)]
    one, other = (tune_catch(streams, seed=3) for _ in range(2))
    assert one == other
    assert one.score.false_positive_rate <= MAX_FALSE_POSITIVE_RATE
    free = tune_catch(streams, seed=3, most_flagged=1.0)
    assert free.score.mean_f1 >= one.score.mean_f1 > 0
