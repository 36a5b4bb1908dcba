from __future__ import annotations

import math

import pytest
from one_attacker import honest

from advpipe.pipeline.core.errors import AdvpipeError


def test_all_fields_are_out_of_range(strike):
    """What the dictionary's codes mean: infinity is "out of range"."""
    (told,) = strike("cam-out-of-range", [honest(0)])
    assert (told.latitude_deg, told.longitude_deg) == (90, 180)
    assert told.heading_rad == pytest.approx(math.tau)  # 3600 tenths of a degree
    assert (told.speed_mps, told.length_m, told.width_m) == (math.inf, math.inf, math.inf)
    assert told.longitudinal_acceleration_mps2 == 16
    assert told.curvature_per_m == pytest.approx(-0.1023)
    assert math.degrees(told.yaw_rate_radps) == pytest.approx(327.66)
    assert told.station_type == 255


def test_one_field_is_out_of_range(strike):
    (told,) = strike("cam-out-of-range", [honest(0)], field="speed")
    assert told.speed_mps == math.inf
    assert (told.latitude_deg, told.length_m, told.station_type) == (48, 4.5, 5)
    with pytest.raises(AdvpipeError, match=r"cam-out-of-range: field is 'colour'; known: all, position"):
        strike("cam-out-of-range", [honest(0)], field="colour")
