"""A receiver's view of pseudonyms: which new station id continues a known station's way.

Honest stations that change their pseudonym would look like vehicles that appear from nowhere, in the place of
another one. Where stations change pseudonyms, checks judge a new one as the station that it continues.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from advpipe.pipeline.misbehaviour.claim import Claim

LONGEST_GAP_S = 15.0
"""A station that was silent for longer is forgotten."""
GATE_M, STRAY_MPS2, WIDEST_M = 4.0, 2.0, 30.0
"""How far from its prediction a station may be: at once, and by accelerating while it is silent; at most."""
HEADING_RAD = math.radians(45)
SIZE_M = 0.15
"""Sizes are stated to 0.1 m."""
CAM_INTERVAL_S = 1.0
"""The longest between two CAMs of a station that is not silent (EN 302 637-2, T_GenCamMax)."""
_SWEEP_NS = 5_000_000_000


class PseudonymLinks:
    """Gives each claim the first station id of its station, in the order of arrival.

    A new id is linked to the nearest station of the same type and size whose predicted place it is at, and
    which no other id has continued. A station id that goes on sending after it was continued stays the same
    station: then two vehicles claim to be one, which the checks find.

    silence_s: the longest silence before a new pseudonym, by the rules that stations follow; 0 where they do
    not fall silent. Who turns meanwhile is not where it was predicted. So a new id that a silent station of
    the same type and size can have reached is not linked, but `may_be_known`, once for each silent one; and
    so is any new id for as long after the first message, as its station may have been silent until then.
    """

    def __init__(self, silence_s: float = 0.0) -> None:
        self._silence_s = silence_s + 2 * CAM_INTERVAL_S if silence_s > 0 else 0.0
        self._begin_ns: int | None = None
        self._first: dict[int, int] = {}
        self._last: dict[int, Claim] = {}
        self._explaining: set[int] = set()
        self._swept_ns = 0

    def linked(self, claims: Iterable[Claim]) -> list[Claim]:
        """The claims, each with the station id under which the receiver knows its station."""
        return [self._linked(claim) for claim in claims]

    def known_as(self, station_id: int) -> int:
        """The first id of a station that was heard under this one."""
        return self._first.get(station_id, station_id)

    def _linked(self, claim: Claim) -> Claim:
        if not claim.is_cam or not math.isfinite(claim.x_m + claim.yaw_rad):
            return claim
        if self._begin_ns is None:
            self._begin_ns = claim.arrival_ns
        self._sweep(claim)
        may_be_known = False
        if claim.station_id not in self._first:
            before = self._continued(claim)
            may_be_known = before is not None or self._is_explained(claim, self._begin_ns)
            self._first[claim.station_id] = claim.station_id if before is None else self._first[before]
            if before is not None:
                del self._last[before]
        self._last[claim.station_id] = claim
        return claim._replace(station_id=self._first[claim.station_id], may_be_known=may_be_known)

    def _continued(self, claim: Claim) -> int | None:
        """The station id whose way this claim of a new one continues; None for a new station."""
        near = [
            (distance_m, station_id)
            for station_id, last in self._last.items()
            if _is_alike(claim, last)
            and 0 < _gap_s(last, claim) <= LONGEST_GAP_S
            and abs(math.remainder(claim.yaw_rad - last.yaw_rad, math.tau)) <= HEADING_RAD
            and (distance_m := _distance_m(last, claim)) <= _gate_m(last, claim)
        ]
        return min(near)[1] if near else None

    def _is_explained(self, claim: Claim, begin_ns: int) -> bool:
        """Whether a new id may be that of a station that was silent until now."""
        if (claim.arrival_ns - begin_ns) / 1e9 <= self._silence_s:
            return True
        reachable = [
            (_distance_m(last, claim), station_id)
            for station_id, last in self._last.items()
            if station_id not in self._explaining
            and _is_alike(claim, last)
            and CAM_INTERVAL_S <= _gap_s(last, claim) <= self._silence_s
            and math.hypot(claim.x_m - last.x_m, claim.y_m - last.y_m) <= _reach_m(last, claim)
        ]
        if reachable:
            self._explaining.add(min(reachable)[1])
        return bool(reachable)

    def _sweep(self, claim: Claim) -> None:
        if claim.arrival_ns - self._swept_ns > _SWEEP_NS:
            self._swept_ns = claim.arrival_ns
            longest_s = max(LONGEST_GAP_S, self._silence_s)
            self._last = {n: one for n, one in self._last.items() if _gap_s(one, claim) <= longest_s}
            self._explaining &= self._last.keys()


def _is_alike(claim: Claim, last: Claim) -> bool:
    return (
        claim.station_type == last.station_type
        and abs(claim.length_m - last.length_m) <= SIZE_M
        and abs(claim.width_m - last.width_m) <= SIZE_M
    )


def _gap_s(last: Claim, claim: Claim) -> float:
    return (claim.generation_ns - last.generation_ns) / 1e9


def _distance_m(last: Claim, claim: Claim) -> float:
    way_m = last.speed_mps * _gap_s(last, claim)
    x_m, y_m = last.x_m + way_m * math.cos(last.yaw_rad), last.y_m + way_m * math.sin(last.yaw_rad)
    return math.hypot(claim.x_m - x_m, claim.y_m - y_m)


def _gate_m(last: Claim, claim: Claim) -> float:
    return min(GATE_M + STRAY_MPS2 * _gap_s(last, claim) ** 2 / 2, WIDEST_M)


def _reach_m(last: Claim, claim: Claim) -> float:
    """How far a station can have driven since, whatever way it took."""
    gap_s = _gap_s(last, claim)
    return GATE_M + last.speed_mps * gap_s + STRAY_MPS2 * gap_s**2 / 2
