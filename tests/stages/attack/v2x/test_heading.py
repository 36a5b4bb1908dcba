from __future__ import annotations

import math

import pytest
from one_attacker import honest


def degrees(cams):
    return [math.degrees(cam.heading_rad) for cam in cams]


def test_heading_is_reversed(strike):
    """East becomes west, 300 degrees become 120."""
    messages = [honest(0), honest(500, heading_rad=math.radians(300))]
    assert degrees(strike("cam-heading-reversed", messages)) == pytest.approx([270, 120], abs=0.05)


def test_heading_rotates(strike):
    """45 degrees a second clockwise, from the first lie at 0.5 s on: 90, then 90 + 45, then 90 + 90."""
    messages = [honest(0), honest(500), honest(1500), honest(2500)]
    told = degrees(strike("cam-heading-rotating", messages, from_ms=500, rate_degps=45.0))
    assert told == pytest.approx([90, 90, 135, 180], abs=0.05)


def test_heading_wraps_at_north(strike):
    told = degrees(strike("cam-heading-rotating", [honest(0), honest(2000)], rate_degps=-60.0))
    assert told == pytest.approx([90, 330], abs=0.05)


def test_an_unavailable_heading_stays_unavailable(strike):
    (told,) = strike("cam-heading-reversed", [honest(0, heading_rad=None)])
    assert told.heading_rad is None
