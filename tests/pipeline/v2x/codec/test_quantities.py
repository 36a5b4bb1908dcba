"""Codes by the table of TS 102 894-2, computed by hand."""

import math

import pytest

from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.codec.cam_error import CamError

DEG = math.pi / 180


@pytest.mark.parametrize(
    ("quantity", "value", "code"),
    [
        (q.LATITUDE, 48.76543214, 487_654_321),
        (q.LATITUDE, None, 900_000_001),
        (q.LONGITUDE, -180.0, -1_800_000_000),
        (q.LONGITUDE, None, 1_800_000_001),
        (q.SEMI_AXIS, 0.501, 51),
        (q.SEMI_AXIS, 40.93, 4093),
        (q.SEMI_AXIS, 40.94, 4094),
        (q.SEMI_AXIS, None, 4095),
        (q.ALTITUDE, 374.5, 37_450),
        (q.ALTITUDE, 9000.0, 800_000),
        (q.ALTITUDE, None, 800_001),
        (q.HEADING, 123.44 * DEG, 1234),
        (q.HEADING, 359.96 * DEG, 0),
        (q.HEADING, -0.1 * DEG, 3599),
        (q.HEADING, 7 * math.tau + 1 * DEG, 10),
        (q.HEADING, None, 3601),
        (q.HEADING_CONFIDENCE, 0.0, 1),
        (q.HEADING_CONFIDENCE, 1 * DEG, 10),
        (q.HEADING_CONFIDENCE, 12.5 * DEG, 125),
        (q.HEADING_CONFIDENCE, 12.6 * DEG, 126),
        (q.HEADING_CONFIDENCE, None, 127),
        (q.SPEED, 0.0, 0),
        (q.SPEED, 0.001, 1),
        (q.SPEED, 13.89, 1389),
        (q.SPEED, 13.8901, 1390),
        (q.SPEED, 163.81, 16_381),
        (q.SPEED, 163.82, 16_382),
        (q.SPEED, math.inf, 16_382),
        (q.SPEED, None, 16_383),
        (q.ACCELERATION, 1.1, 11),  # 1.1 * 10 is a little above 11 in binary
        (q.ACCELERATION, 1.11, 12),
        (q.ACCELERATION, -1.25, -12),
        (q.ACCELERATION, -20.0, -160),
        (q.ACCELERATION, 16.1, 160),
        (q.ACCELERATION, None, 161),
        (q.ACCELERATION_CONFIDENCE, 10.1, 101),
        (q.ACCELERATION_CONFIDENCE, None, 102),
        (q.CURVATURE, -0.0037, -37),
        (q.CURVATURE, 1 / 5, 1022),
        (q.CURVATURE, -1 / 5, -1023),
        (q.CURVATURE, None, 1023),
        (q.CURVATURE_CONFIDENCE, 0.0, "onePerMeter-0-00002"),
        (q.CURVATURE_CONFIDENCE, 0.002, "onePerMeter-0-002"),
        (q.CURVATURE_CONFIDENCE, 0.11, "outOfRange"),
        (q.YAW_RATE, -5.12 * DEG, -512),
        (q.YAW_RATE, 1000 * DEG, 32_766),
        (q.YAW_RATE, None, 32_767),
        (q.YAW_RATE_CONFIDENCE, 0.1 * DEG, "degSec-000-10"),
        (q.YAW_RATE_CONFIDENCE, 0.11 * DEG, "degSec-001-00"),
        (q.YAW_RATE_CONFIDENCE, None, "unavailable"),
        (q.ALTITUDE_CONFIDENCE, 0.3, "alt-000-50"),
        (q.ALTITUDE_CONFIDENCE, 200.0, "alt-200-00"),
        (q.ALTITUDE_CONFIDENCE, math.inf, "outOfRange"),
        (q.STEERING_ANGLE, -30 * DEG, -20),
        (q.STEERING_ANGLE, None, 512),
        (q.LENGTH, 4.5, 45),
        (q.LENGTH, 4.51, 46),
        (q.LENGTH, 103.0, 1022),
        (q.LENGTH, None, 1023),
        (q.WIDTH, 1.8, 18),
        (q.WIDTH, 6.1, 61),
        (q.WIDTH, None, 62),
        (q.DELTA_DEGREES, -0.0131071, -131_071),
        (q.DELTA_DEGREES, None, 131_072),
        (q.DELTA_ALTITUDE, None, 12_800),
        (q.DELTA_TIME, 1.1, 110),
        (q.DELTA_TIME, 0.0, 1),
    ],
)
def test_codes_equal_those_of_the_dictionary(
    quantity: q.CamQuantity | q.Classes, value: float | None, code: int | str
) -> None:
    assert quantity.code(value) == code


def test_out_of_range_and_unavailable_are_distinct() -> None:
    assert q.SPEED.value(16_382) == math.inf
    assert q.SPEED.value(16_383) is None
    assert q.YAW_RATE_CONFIDENCE.value("outOfRange") == math.inf
    assert q.YAW_RATE_CONFIDENCE.value("unavailable") is None


@pytest.mark.parametrize(
    ("quantity", "value"),
    [
        (q.SPEED, -0.5),
        (q.SPEED, math.nan),
        (q.SPEED, -math.inf),
        (q.LATITUDE, 90.1),
        (q.LATITUDE, math.inf),
        (q.HEADING, math.inf),
        (q.DELTA_DEGREES, 0.02),
        (q.DELTA_TIME, None),
        (q.YAW_RATE_CONFIDENCE, -1.0),
        (q.ALTITUDE_CONFIDENCE, math.nan),
    ],
)
def test_values_that_no_cam_can_represent_are_refused_by_name(
    quantity: q.CamQuantity | q.Classes, value: float
) -> None:
    with pytest.raises(CamError, match=quantity.name):
        quantity.code(value)
