"""What can be measured of a V2X message that an attack changed, delayed or added."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from advpipe.pipeline.labels.quantity import Quantity
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.codec import quantities as q
from advpipe.pipeline.v2x.facilities.cam_values import Values


class MessageChange(NamedTuple):
    """A message as one attack was given it and as it handed it on.

    before, after: its values; None if it is no CAM or was added. delay_s: how much later it is sent, 0 for a
    message that is only changed; None for an added one. added_in_a_second: for an added message, how many its
    attacker has added in the second that ends with it, itself included. moved_m: the offset of the position
    where it is known already, NaN for none; None to measure it.
    """

    geodesy: Geodesy
    before: Values | None = None
    after: Values | None = None
    delay_s: float | None = None
    added_in_a_second: int | None = None
    moved_m: float | None = None


def _position_offset_m(change: MessageChange) -> float | None:
    if change.moved_m is not None:
        return change.moved_m if math.isfinite(change.moved_m) else None
    before_m, after_m = (_place_m(change.geodesy, claims) for claims in (change.before, change.after))
    if before_m is None or after_m is None:
        return None
    return math.hypot(after_m[0] - before_m[0], after_m[1] - before_m[1])


def _place_m(geodesy: Geodesy, claims: Values | None) -> tuple[float, float] | None:
    """As `cam_values.places_m`, of one message and in a fraction of the time."""
    if claims is None or claims["latitude_deg"] is None or claims["longitude_deg"] is None:
        return None
    latitude_deg, longitude_deg = claims["latitude_deg"], claims["longitude_deg"]
    if not (abs(latitude_deg) < 90 and abs(longitude_deg) <= 180):
        return None
    x_m, y_m = geodesy.place_m(latitude_deg, longitude_deg)
    return (x_m, y_m) if math.isfinite(x_m + y_m) else None


def _speed_offset_mps(change: MessageChange) -> float | None:
    before_mps, after_mps = (
        None if claims is None else claims["speed_mps"] for claims in (change.before, change.after)
    )
    if before_mps is None or after_mps is None:
        return None
    fastest_mps = q.SPEED.high / q.SPEED.per_unit
    return float(abs(min(after_mps, fastest_mps) - min(before_mps, fastest_mps)))


POSITION_OFFSET = Quantity[MessageChange](
    "position_offset_m",
    "m",
    "horizontal offset of the reported position",
    _position_offset_m,
    resolution=0.01,
)
"""Where both state a position, which a CAM quantises to 1e-7 degrees."""
SPEED_OFFSET = Quantity[MessageChange](
    "speed_offset_mps",
    "m/s",
    "absolute change of the reported speed",
    _speed_offset_mps,
    resolution=1 / q.SPEED.per_unit,
)
"""Where both state a speed, which a CAM rounds up; a speed beyond its range counts as the maximum of the
range."""
DELAY = Quantity[MessageChange]("delay_s", "s", "delay of a message", lambda change: change.delay_s)
MESSAGES_ADDED = Quantity[MessageChange](
    "messages_added_per_s",
    "1",
    "messages an attacker added within one second",
    lambda change: change.added_in_a_second,
)

MESSAGE_QUANTITIES: Mapping[str, Quantity[MessageChange]] = {
    quantity.name: quantity for quantity in (POSITION_OFFSET, SPEED_OFFSET, DELAY, MESSAGES_ADDED)
}
