"""What honest vehicles do that checks of CAMs take for lies: turns of long bodies, spins, hard braking."""

from __future__ import annotations

import math
from dataclasses import dataclass

from advpipe.pipeline.misbehaviour.checks import elapsed_s
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.misbehaviour.config import GRIP_MPS2

LONG_M = 6.0
"""Longer bodies are lorries and buses."""
TURN_RADPS = 0.05
"""Yaw rate from which a vehicle turns."""
MOST_CODED_RADPS = math.radians(327.65)
"""A CAM cannot state a greater yaw rate (CDD, `YawRateValue`: 327.66 °/s means that or more)."""
AFTER_NS = 2_000_000_000
"""A turn excuses the CAMs of so long after it, some of which are compared with one before it."""
MEMORY_NS = 10_000_000_000

OF_LONG_TURNS = frozenset({"heading", "wrong_way"})
"""A long body stands across the lanes while it turns, and its middle moves across its heading: that of a
semi-trailer as far as backwards."""
BESIDE_LANES = frozenset({"position"})
"""Its middle lies beside the lanes meanwhile, but by no more than half of its length."""
OF_SPINS = frozenset({"turn"})
OF_BRAKING = frozenset({"dynamics"})

_SPEED_MPS, _SHARE = 0.1, 0.3
"""By how much a change of speed may miss the claimed accelerations, and still bears them out."""


@dataclass
class _Manoeuvre:
    """Of one station: its newest claim, and when it last turned with a long body, or spun."""

    last: Claim
    turned_ns: int = -AFTER_NS
    spun_ns: int = -AFTER_NS


class Manoeuvres:
    """What each station was doing of late."""

    def __init__(self) -> None:
        self._stations: dict[int, _Manoeuvre] = {}
        self._swept_ns = 0

    def excuses(self, claim: Claim) -> frozenset[str]:
        """The checks that say nothing about a station's next claim; claims come in order of arrival."""
        self._forget(claim.arrival_ns)
        known = self._stations.get(claim.station_id)
        one = known or _Manoeuvre(claim)
        now_ns, rate_radps = claim.arrival_ns, abs(claim.yaw_rate_radps)
        if claim.length_m > LONG_M and rate_radps > TURN_RADPS:
            one.turned_ns = now_ns
        if rate_radps >= MOST_CODED_RADPS:
            one.spun_ns = now_ns
        found: frozenset[str] = frozenset()
        if now_ns - one.turned_ns < AFTER_NS:
            found |= OF_LONG_TURNS
            if claim.off_road_m <= claim.length_m / 2:
                found |= BESIDE_LANES
        if now_ns - one.spun_ns < AFTER_NS:
            found |= OF_SPINS
        if known is not None and _brakes_truly(claim, known.last):
            found |= OF_BRAKING
        one.last = claim
        self._stations[claim.station_id] = one
        return found

    def _forget(self, now_ns: int) -> None:
        if now_ns - self._swept_ns > MEMORY_NS:
            self._swept_ns = now_ns
            self._stations = {
                number: one
                for number, one in self._stations.items()
                if now_ns - one.last.arrival_ns < MEMORY_NS
            }


def _brakes_truly(claim: Claim, last: Claim) -> bool:
    """Whether tyres allow the claimed decelerations, and the speeds change by them."""
    t = elapsed_s(claim, last)
    rates = sorted((claim.acceleration_mps2, last.acceleration_mps2))
    most_mps2 = max(map(abs, rates))
    if not (t > 0 and most_mps2 <= GRIP_MPS2):
        return False
    changed_mps, slack_mps = claim.speed_mps - last.speed_mps, _SPEED_MPS + _SHARE * most_mps2 * t
    is_borne_out = rates[0] * t - slack_mps <= changed_mps <= rates[1] * t + slack_mps
    return rates[0] < 0 and is_borne_out
