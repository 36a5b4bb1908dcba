"""A simple tracker: it hears every CAM of a drive, and links new pseudonyms to those that have fallen silent.

It predicts where the stations that fell silent would be by their last speed and heading, and takes the
nearest one that is not farther away than a station can have strayed (Wiedersheim et al., WONS 2010, track so
with a Kalman filter). It knows neither sizes nor signatures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

LONGEST_GAP_NS = 20_000_000_000
"""A station that was silent for longer counts as gone."""
GATE_M, STRAY_MPS2, WIDEST_M = 5.0, 2.0, 60.0
"""How far from its prediction a station may be: at once, and by accelerating while it is silent; at most."""


class Sighting(NamedTuple):
    """One end of a pseudonym's use, as a CAM states it on the map."""

    time_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float


@dataclass(frozen=True)
class PseudonymTrack:
    """The first and the last CAM of a pseudonym."""

    pseudonym: int
    first: Sighting
    last: Sighting


def linked(tracks: Sequence[PseudonymTrack]) -> dict[int, int]:
    """The pseudonym that the tracker takes for the predecessor of each new one, where it takes any.

    A predecessor fell silent before the new one appeared, and has one successor.
    """
    found: dict[int, int] = {}
    ended = sorted(tracks, key=lambda one: (one.last.time_ns, one.pseudonym))
    taken: set[int] = set()
    for track in sorted(tracks, key=lambda one: (one.first.time_ns, one.pseudonym)):
        near = [
            (distance_m, one.pseudonym)
            for one in ended
            if one.pseudonym not in taken
            and 0 < track.first.time_ns - one.last.time_ns <= LONGEST_GAP_NS
            and (distance_m := _distance_m(one.last, track.first)) <= _gate_m(one.last, track.first)
        ]
        if near:
            _, found[track.pseudonym] = min(near)
            taken.add(found[track.pseudonym])
    return found


def _distance_m(last: Sighting, first: Sighting) -> float:
    """Of a sighting from the place that an earlier one predicts."""
    way_m = last.speed_mps * (first.time_ns - last.time_ns) / 1e9
    x_m, y_m = last.x_m + way_m * math.cos(last.yaw_rad), last.y_m + way_m * math.sin(last.yaw_rad)
    return math.hypot(first.x_m - x_m, first.y_m - y_m)


def _gate_m(last: Sighting, first: Sighting) -> float:
    gap_s = (first.time_ns - last.time_ns) / 1e9
    return min(GATE_M + STRAY_MPS2 * gap_s**2 / 2, WIDEST_M)
