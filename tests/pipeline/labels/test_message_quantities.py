"""Quantities of a changed, delayed or added message, worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import pytest

from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES, MessageChange
from advpipe.pipeline.labels.quantity import excesses
from advpipe.pipeline.localisation.geodesy import Geodesy

GEODESY = Geodesy(48.0, 11.0, 520.0)
NORTH_M = 111_190.32
"""Metres to a degree at 48 degrees north, by the series in the literature."""


def said(**values: Any) -> dict[str, Any]:
    return {"latitude_deg": 48.0, "longitude_deg": 11.0, "speed_mps": 10.0, **values}


def measured(change: MessageChange) -> dict[str, float | None]:
    return {name: quantity.measure(change) for name, quantity in MESSAGE_QUANTITIES.items()}


def test_a_changed_message() -> None:
    change = MessageChange(GEODESY, said(), said(latitude_deg=48.0 - 70 / NORTH_M, speed_mps=4.0), 1.5)
    found = measured(change)
    assert found.pop("position_offset_m") == pytest.approx(70, abs=0.02)
    assert found == {"speed_offset_mps": 6.0, "delay_s": 1.5, "messages_added_per_s": None}


@pytest.mark.parametrize(
    "after", [None, said(latitude_deg=None, speed_mps=None), said(longitude_deg=181.0, speed_mps=None)]
)
def test_what_states_no_place_and_no_speed(after: dict[str, Any] | None) -> None:
    found = measured(MessageChange(GEODESY, said(), after, 0.0))
    assert (found["position_offset_m"], found["speed_offset_mps"]) == (None, None)


def test_a_speed_beyond_what_a_cam_can_tell() -> None:
    found = measured(MessageChange(GEODESY, said(), said(speed_mps=math.inf), 0.0))
    assert found["speed_offset_mps"] == pytest.approx(163.81 - 10)


def test_an_added_message() -> None:
    change = MessageChange(GEODESY, added_in_a_second=41)
    assert {name: value for name, value in measured(change).items() if value is not None} == {
        "messages_added_per_s": 41
    }
    bounds = {"messages_added_per_s": (0.0, 40.0), "delay_s": (2.0, 4.0)}
    assert list(excesses(change, bounds, MESSAGE_QUANTITIES)) == [
        "messages an attacker added within one second: 41, but the attack declares 0 to 40 "
        "(messages_added_per_s)"
    ]
