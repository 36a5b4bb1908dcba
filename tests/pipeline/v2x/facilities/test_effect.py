from __future__ import annotations

import math

import pytest

from advpipe.pipeline.v2x.codec.codes import DriveDirection
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.pipeline.v2x.facilities.cam_values import changed_fields, values_of_payload
from advpipe.pipeline.v2x.facilities.effect import fix_has_effect, has_effect


def claimed(time_ms=0, **fields):
    """The claims of a car at 48 degrees north and 11 east, heading east at 10 m/s."""
    usual = {
        "station_id": 7,
        "station_type": 5,
        "generation_delta_time_ms": time_ms % 65536,
        "latitude_deg": 48.0,
        "longitude_deg": 11.0,
        "heading_rad": math.pi / 2,
        "speed_mps": 10.0,
        "drive_direction": DriveDirection.FORWARD,
        "length_m": 4.5,
        "width_m": 1.8,
        "longitudinal_acceleration_mps2": 1.0,
        "yaw_rate_radps": 0.0,
        "curvature_per_m": 0.0,
    }
    return values_of_payload(encode_cam(Cam(**(usual | fields))))


@pytest.mark.parametrize(
    ("true", "false", "expected"),
    [
        ({"speed_mps": 0.0}, {"speed_mps": 0.0}, False),  # a standing car that claims to stand
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
def test_differences_above_the_thresholds_have_an_effect(true, false, expected):
    assert has_effect(claimed(**true), claimed(**false), 0.0, 1.1) == expected


def test_fixes_and_messages_follow_the_same_rule():
    """0.6 m and 0.8 m aside are 1 m: the bound itself; 5 m in height."""
    assert not fix_has_effect(0.6, -0.8, 5.0)
    assert fix_has_effect(0.61, -0.8, 0.0)
    assert fix_has_effect(0.0, 0.0, -5.1)


def test_differences_of_position_and_time_have_an_effect():
    """More than a metre; a time by which the map's entry has expired, over the cycle of 65.536 s as well."""
    assert not has_effect(claimed(), claimed(), 0.9, 1.1)
    assert has_effect(claimed(), claimed(), 1.1, 1.1)
    assert not has_effect(claimed(1000), claimed(0), 0.0, 1.1)
    assert has_effect(claimed(1200), claimed(0), 0.0, 1.1)
    assert not has_effect(claimed(66_000), claimed(0), 0.0, 1.1)
    assert has_effect(claimed(), None, math.nan, 1.1)
    assert has_effect(claimed(), claimed(latitude_deg=None), math.nan, 1.1)


def test_changed_fields_are_listed():
    assert changed_fields(claimed(), claimed(speed_mps=3.0, latitude_deg=47.0)) == "latitude_deg,speed_mps"
    assert changed_fields(claimed(), claimed(heading_rad=None)) == "heading_rad"
    assert changed_fields(claimed(), claimed(performance_class=1)) == "other"
    assert values_of_payload(b"no CAM") is None
