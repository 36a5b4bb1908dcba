"""Two simple checks of received warnings (DENMs), against what else the vehicle has heard by radio."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.v2x.facilities.denm import ActionId, Denm, EventKind, Termination
from advpipe.pipeline.v2x.facilities.own_state import STANDING_MPS

FAR_M = 25.0
"""A vehicle announces what happens to itself: the event is at the place that its CAMs state."""
LATELY_NS = 1_500_000_000
"""CAMs and DENMs of this age still say something about a station."""


def flagged(
    denms: Sequence[tuple[int, Denm, tuple[float, float]]], cams: Mapping[int, Sequence[Claim]]
) -> list[bool]:
    """Which DENMs are implausible, in the order of their arrival.

    denms: arrival, message, and the place of its event on the map. cams: by the station id that they claim,
    by arrival.

    An event is, if its originator's last CAM is of another place (`FAR_M`) or, where it is to stand, of a
    vehicle that drives. An end is, if it is a negation of an event that its originator announced lately, or a
    cancellation of one that it still announces afterwards.
    """
    announced: dict[ActionId, list[int]] = {}
    for arrival_ns, denm, _ in denms:
        if denm.termination is None:
            announced.setdefault(denm.action, []).append(arrival_ns)
    found = []
    for arrival_ns, denm, place_m in denms:
        times_ns = announced.get(denm.action, [])
        if denm.termination is Termination.NEGATION:
            found.append(any(0 <= arrival_ns - at_ns <= LATELY_NS for at_ns in times_ns))
        elif denm.termination is Termination.CANCELLATION:
            found.append(any(0 < at_ns - arrival_ns <= LATELY_NS for at_ns in times_ns))
        else:
            found.append(_contradicts(denm, place_m, arrival_ns, cams.get(denm.station_id, ())))
    return found


def _contradicts(denm: Denm, place_m: tuple[float, float], arrival_ns: int, cams: Sequence[Claim]) -> bool:
    last = next((one for one in reversed(cams) if one.arrival_ns <= arrival_ns), None)
    if last is None or arrival_ns - last.arrival_ns > LATELY_NS:
        return False
    far_m = math.hypot(last.x_m - place_m[0], last.y_m - place_m[1])
    is_driving = denm.kind is EventKind.STOPPED and abs(last.speed_mps) > 10 * STANDING_MPS
    return far_m - last.length_m / 2 > FAR_M or is_driving
