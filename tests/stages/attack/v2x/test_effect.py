from __future__ import annotations

import math

import pytest
from one_attacker import honest

from advpipe.pipeline.v2x.codec import decode
from advpipe.stages.attack.v2x.effect import matters


def tree(time_ms=0, **fields):
    return decode(honest(time_ms, **fields).payload)


@pytest.mark.parametrize(
    ("true", "false", "expected"),
    [
        ({"speed_mps": 0.0}, {"speed_mps": 0.0}, False),  # a standing car that says so
        ({"speed_mps": 0.9}, {"speed_mps": 0.0}, False),
        ({"speed_mps": 1.2}, {"speed_mps": 0.0}, True),
        ({"speed_mps": 1.2}, {"speed_mps": math.inf}, True),
        ({"heading_rad": 0.05}, {"heading_rad": math.tau - 0.05}, False),  # 6 degrees, over north
        ({"heading_rad": 0.05}, {"heading_rad": math.tau - 0.2}, True),
        ({"longitudinal_acceleration_mps2": 0.1}, {"longitudinal_acceleration_mps2": 0.4}, False),
        ({"longitudinal_acceleration_mps2": 0.1}, {"longitudinal_acceleration_mps2": -3.0}, True),
        ({}, {"station_id": 9}, True),
        ({}, {"heading_rad": None}, True),
        ({}, {"length_m": 4.9}, False),
        ({}, {"length_m": 5.1}, True),
    ],
)
def test_thresholds(true, false, expected):
    assert matters(tree(**true), tree(**false), 0.0, 1.1) == expected


def test_place_and_time():
    """More than a metre; a time by which the map's entry has expired, over the cycle of 65.536 s as well."""
    assert not matters(tree(), tree(), 0.9, 1.1)
    assert matters(tree(), tree(), 1.1, 1.1)
    assert not matters(tree(1000), tree(0), 0.0, 1.1)
    assert matters(tree(1200), tree(0), 0.0, 1.1)
    assert not matters(tree(66_000), tree(0), 0.0, 1.1)
    assert matters(tree(), None, math.nan, 1.1)
    assert matters(tree(), tree(latitude_deg=None), math.nan, 1.1)
