from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from advpipe.pipeline.v2x.facilities.pseudonyms import PseudonymChanger
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.section import PseudonymRules

START_NS, STEP_NS = 1_767_268_800_000_000_000, 100_000_000
METRE_DEG = 1 / 111_200

Car = Callable[..., StationState]


def changes(
    car: Car,
    rules: PseudonymRules,
    steps: int,
    locked: Sequence[int] = (),
    speed_mps: Callable[[int], float] = lambda step: 10.0,
) -> tuple[list[int], list[int]]:
    """The steps in which a car that drives 1 m north a step changes its pseudonym, and those of silence."""
    changer = PseudonymChanger(rules, np.random.default_rng(1))
    changed, silent = [], []
    for step in range(steps):
        time_ns = START_NS + step * STEP_NS
        state = car(time_ns=time_ns, latitude_deg=48 + step * METRE_DEG, speed_mps=speed_mps(step))
        if changer.update(state, step in locked):
            changed.append(step)
        if changer.is_silent:
            silent.append(step)
    return changed, silent


def test_by_period_each_use_is_drawn_within_the_variation(car: Car) -> None:
    changed, silent = changes(car, PseudonymRules(period_s=2, variation=0.5), 400)
    uses = np.diff(changed)
    assert changed[0] <= 20
    assert 10 <= min(uses) < 15 < 25 < max(uses) <= 31
    assert not silent


def test_by_distance_a_station_that_drives_changes(car: Car) -> None:
    rules = PseudonymRules(strategy="distance", distance_m=30, variation=0)
    changed, _ = changes(car, rules, 200)
    assert set(np.diff(changed)) <= {30, 31}
    assert len(changed) >= 5


def test_a_silence_comes_before_the_new_pseudonym(car: Car) -> None:
    rules = PseudonymRules(
        strategy="silent_period", period_s=3, variation=0, silent_min_s=0.5, silent_max_s=1.5
    )
    changed, silent = changes(car, rules, 200)
    for step in changed:
        before = [one for one in silent if step - 20 < one < step]
        assert before == list(range(step - len(before), step))
        assert 5 <= len(before) <= 16


def test_a_vehicle_waits_for_its_own_manoeuvre(car: Car) -> None:
    rules = PseudonymRules(strategy="vehicle_centric", period_s=2, variation=0, speed_mps=3)
    steady, _ = changes(car, rules, 200)
    assert steady == []
    braking, _ = changes(car, rules, 200, speed_mps=lambda step: 10.0 if step < 100 else 5.0)
    assert braking == [100]


@pytest.mark.parametrize("strategy", ["period", "silent_period"])
def test_no_change_begins_while_an_application_needs_the_pseudonym(car: Car, strategy: str) -> None:
    rules = PseudonymRules(strategy=strategy, period_s=1, silent_min_s=0.2, silent_max_s=0.2)  # type: ignore[arg-type]
    changed, silent = changes(car, rules, 100, locked=range(20, 70))
    assert not {*silent} & {*range(20, 70)}
    assert not [step for step in changed if 21 <= step < 70]
    assert [step for step in changed if step < 20]
    assert [step for step in changed if step >= 70]


def test_turning_is_a_manoeuvre(car: Car) -> None:
    changer = PseudonymChanger(
        PseudonymRules(strategy="vehicle_centric", period_s=1, variation=0), np.random.default_rng(1)
    )
    found = []
    for step in range(60):
        heading_rad = math.radians(0 if step < 30 else 25)
        if changer.update(car(time_ns=START_NS + step * STEP_NS, heading_rad=heading_rad), False):
            found.append(step)
    assert found == [30]
