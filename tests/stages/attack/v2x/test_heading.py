from __future__ import annotations

import math

import pytest
from one_attacker import genuine


def degrees(cams):
    return [math.degrees(cam.heading_rad) for cam in cams]


def test_heading_is_reversed(attacked_cams):
    """East becomes west, 300 degrees become 120."""
    messages = [genuine(0), genuine(500, heading_rad=math.radians(300))]
    assert degrees(attacked_cams("cam-heading-reversed", messages)) == pytest.approx([270, 120], abs=0.05)


def test_heading_rotates(attacked_cams):
    """45 degrees a second clockwise, from the first false message at 0.5 s on: 90, 90 + 45, 90 + 90."""
    messages = [genuine(0), genuine(500), genuine(1500), genuine(2500)]
    reported = degrees(attacked_cams("cam-heading-rotating", messages, from_ms=500, rate_degps=45.0))
    assert reported == pytest.approx([90, 90, 135, 180], abs=0.05)


def test_heading_wraps_at_north(attacked_cams):
    reported = degrees(attacked_cams("cam-heading-rotating", [genuine(0), genuine(2000)], rate_degps=-60.0))
    assert reported == pytest.approx([90, 330], abs=0.05)


def test_an_unavailable_heading_stays_unavailable(attacked_cams):
    (reported,) = attacked_cams("cam-heading-reversed", [genuine(0, heading_rad=None)])
    assert reported.heading_rad is None
