"""A record of a published log of beacons, value by value as the log has it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError

OWN, RECEIVED, TRUTH = 2, 3, 4
"""A receiver's own state, a beacon that it received, and what was truly sent: VeReMi's numbers."""

EPOCH_NS = 1_577_836_800 * 10**9
"""The begin of 2020: logs count from a begin of their own, CAMs from a date."""

_NO_NUMBERS = ("NaN", "Infinity", "-Infinity")
"""What Java writes for a quotient by zero, such as the acceleration of a first message."""

Vector = tuple[float, float, float]
NOTHING: Vector = (math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class BeaconState:
    """The values of a vehicle, in the units and the shape of the log; as in `advpipe_msgs/BeaconState`."""

    position: Vector = NOTHING
    position_noise: Vector = NOTHING
    speed: Vector = NOTHING
    speed_noise: Vector = NOTHING
    acceleration: Vector = NOTHING
    acceleration_noise: Vector = NOTHING
    heading: Vector = NOTHING
    heading_noise: Vector = NOTHING


@dataclass(frozen=True, slots=True)
class BeaconRecord:
    """One record; the fields are those of `advpipe_msgs/BeaconLog`. stamp_ns: since 1970, of the bag."""

    kind: int
    file: str
    place: int
    stamp_ns: int
    sent_ns: int | None
    receiver: str
    sender: str
    pseudonym: str
    message: str
    receive_time: float
    send_time: float
    attacker: int
    rssi: float
    state: BeaconState
    own_state: BeaconState
    text: str


def text_of(values: Mapping[str, Any]) -> str:
    """A record as JSON; the digits of Python's shortest form, which give back the same numbers."""
    return json.dumps(values, separators=(",", ":"), ensure_ascii=False)


def number(values: Mapping[str, Any], key: str, where: str, missing: float | None = None) -> float:
    """A finite number, also one in a text as NextGen writes it. Raises AdvpipeError for another value, and
    for none where it may not be missing."""
    value = values.get(key)
    if missing is not None and (value is None or value in _NO_NUMBERS):
        return missing
    try:
        found = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        found = math.nan
    if not math.isfinite(found):
        raise AdvpipeError(f"{where}: {key} is {str(value)[:40]!r}, not a number; download the log again")
    return found


def vector(values: Mapping[str, Any], key: str, where: str) -> Vector:
    """Three numbers, in a list or in a text with commas; `NOTHING` for a missing key."""
    value = values.get(key)
    if value is None:
        return NOTHING
    parts = value.split(",") if isinstance(value, str) else value
    if not isinstance(parts, list) or len(parts) != 3:
        raise AdvpipeError(f"{where}: {key} is {str(value)[:40]!r}, not three numbers; download it again")
    x, y, z = (number({key: part}, key, where) for part in parts)
    return x, y, z


def word(values: Mapping[str, Any], key: str) -> str:
    """A name or whole number as text; empty where there is none."""
    value = values.get(key)
    return "" if value is None else str(value)
