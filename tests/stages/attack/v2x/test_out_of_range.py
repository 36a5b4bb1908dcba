from __future__ import annotations

import math

import pytest
from one_attacker import genuine

from advpipe.pipeline.core.errors import AdvpipeError


def test_all_fields_are_out_of_range(attacked_cams):
    """What the dictionary's codes mean: infinity is "out of range"."""
    (reported,) = attacked_cams("cam-out-of-range", [genuine(0)])
    assert (reported.latitude_deg, reported.longitude_deg) == (90, 180)
    assert reported.heading_rad == pytest.approx(math.tau)  # 3600 tenths of a degree
    assert (reported.speed_mps, reported.length_m, reported.width_m) == (math.inf, math.inf, math.inf)
    assert reported.longitudinal_acceleration_mps2 == 16
    assert reported.curvature_per_m == pytest.approx(-0.1023)
    assert math.degrees(reported.yaw_rate_radps) == pytest.approx(327.66)
    assert reported.station_type == 255


def test_one_field_is_out_of_range(attacked_cams):
    (reported,) = attacked_cams("cam-out-of-range", [genuine(0)], field="speed")
    assert reported.speed_mps == math.inf
    assert (reported.latitude_deg, reported.length_m, reported.station_type) == (48, 4.5, 5)
    with pytest.raises(AdvpipeError, match=r"cam-out-of-range: field is 'colour'; known: all, position"):
        attacked_cams("cam-out-of-range", [genuine(0)], field="colour")
