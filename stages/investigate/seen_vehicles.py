"""The vehicles that a LiDAR has seen where their CAMs put them: tracks that do not vanish in free sight."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from advpipe.pipeline.misbehaviour.checks import claimed_box
from advpipe.pipeline.misbehaviour.claim import Claim

CONFIRMED = 5
"""Clouds in which a vehicle was seen, before it counts as a track."""
REMEMBERED_S = 1.0
"""For so long after it was last seen, a track tells where the vehicle must be."""
SAME_PLACE_M = 2.0
CARRIED_S = 5.0
"""For so long a vehicle that vanished counts as on its track while its claims go on as before."""


@dataclass
class _Track:
    claim: Claim
    time_ns: int
    clouds: int = 1
    seen_ns: int = 0


@dataclass
class SeenVehicles:
    """The newest claims of which a LiDAR saw the vehicle, by station."""

    _tracks: dict[int, _Track] = field(default_factory=dict)

    def see(self, number: int, claim: Claim, time_ns: int) -> None:
        """A LiDAR sees a station's vehicle where it claims to be."""
        known = self._tracks.get(number)
        if known is None or time_ns - known.time_ns > REMEMBERED_S * 1e9:
            self._tracks[number] = _Track(claim, time_ns, seen_ns=time_ns)
        else:
            self._tracks[number] = _Track(claim, time_ns, known.clouds + 1, time_ns)

    def forget(self, now_ns: int) -> None:
        """Drop the tracks that were last seen too long ago."""
        oldest_ns = now_ns - REMEMBERED_S * 1e9
        self._tracks = {number: one for number, one in self._tracks.items() if one.time_ns >= oldest_ns}

    def expected(self, time_ns: int) -> Mapping[int, tuple[float, ...]]:
        """By station, the box of each track not seen at a time, moved on there; old ones are forgotten."""
        self.forget(time_ns)
        boxes = {
            number: claimed_box(one.claim, time_ns)
            for number, one in self._tracks.items()
            if one.clouds >= CONFIRMED and one.time_ns < time_ns
        }
        return {number: box for number, box in boxes.items() if box is not None}

    def is_on_track(self, number: int, claim: Claim, time_ns: int) -> bool:
        """Whether a claimed vehicle is where its track leads, which it prolongs: its station has not begun to
        lie about its place."""
        box, known = claimed_box(claim, time_ns), self.expected(time_ns).get(number)
        if box is None or known is None or math.hypot(known[0] - box[0], known[1] - box[1]) > SAME_PLACE_M:
            return False
        track = self._tracks[number]
        if time_ns - track.seen_ns > CARRIED_S * 1e9:
            return False
        track.claim, track.time_ns = claim, time_ns
        return True
