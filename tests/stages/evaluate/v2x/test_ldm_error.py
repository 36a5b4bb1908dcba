"""Maps against the truth, counted by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.scenario.attacks import Attackers, AttackSpec, RoadsideUnit
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.v2x.ldm_error import Known, Moment, ldm_error, moments


def radio(station_id: int, x_m: float, speed_mps: float = 0.0) -> RadioPlace:
    size_m = (4.0, 2.0, 1.5)
    return RadioPlace(
        station_id, f"car{station_id}", se3_from_yaw([x_m, 0, 0], 0), size_m, np.array([speed_mps, 0, 0])
    )


def entry(station_id: int, x_m: float, speed_mps: float = 0.0) -> Known:
    return Known(station_id, x_m, 0.0, 0.0, speed_mps, 4.0, 2.0)


def test_counts() -> None:
    """Station 2 is known to 1 m, 3 is 4 m off, 4 is missing, 5 is too far to be missed, 6 and 1 are false.

    7 has just left the road: its entry may still be there.
    """
    moment = Moment(
        10**9,
        radio(1, 0.0),
        (entry(2, 11.0), entry(3, 24.0), entry(6, 5.0), entry(1, 3.0), entry(7, 50.0)),
        (radio(2, 10.0), radio(3, 20.0), radio(4, 30.0), radio(5, 400.0)),
        frozenset({1, 2, 3, 4, 5, 7}),
    )
    row = vars(ldm_error([moment]).figures())
    assert row == {
        "known": 5.0,
        "stations": 3.0,
        "false_entries": 2.0,
        "false_entries_max": 2.0,
        "missing": 1.0,
        "displaced": 1.0,
        "error_m": pytest.approx((1.0 + 4.0) / 2),
    }


def test_an_empty_map_has_no_error() -> None:
    error = ldm_error([Moment(0, radio(1, 0.0), (), (radio(2, 10.0),), frozenset({1, 2}))])
    assert math.isnan(error.figures().error_m)
    assert error.missing.tolist() == [1.0]
    assert math.isnan(ldm_error([]).figures().false_entries)


def test_out_of_range_is_displaced() -> None:
    far = entry(2, math.inf)
    error = ldm_error([Moment(0, radio(1, 0.0), (far,), (radio(2, 10.0),), frozenset({1, 2}))])
    assert error.displaced.tolist() == [1.0]


def test_a_roadside_unit_is_no_vehicle_and_what_it_claims_to_be_a_ghost(smoke: Path, tmp_path: Path) -> None:
    before = list(moments(BagReader(smoke), "ego", 1.1))
    place = before[-1].own.map_SE3_base[:2, 3].tolist()
    unit = Attackers(roadside_unit=RoadsideUnit(x_m=place[0] + 10, y_m=place[1]))
    spec = AttackSpec(type="cam-dos-random", parameters={"rate_hz": 5.0}, attackers=unit)
    attack(smoke, tmp_path / "out", AttackRequest((spec,)))
    after = list(moments(BagReader(tmp_path / "out"), "ego", 1.1))
    assert [len(moment.others) for moment in after] == [len(moment.others) for moment in before]
    assert ldm_error(before).false_entries.max() == 0
    assert ldm_error(after).false_entries.max() == 1  # one station id, wherever it claims to be
