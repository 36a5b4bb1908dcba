"""CAMs against other stations and the own place: who stands in another one, or appears from nowhere."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.misbehaviour.checks import appearance_m, claimed_box, claimed_range_m, overlap_share
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.misbehaviour.config import THRESHOLDS, DetectorConfig
from advpipe.stages.investigate.cue import Cue, CueReading, station
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

MEMORY_S = 30.0
"""A station that was silent for longer is new again."""

FAMILIAR_CLAIMS = 5
"""Of two stations in one place, the one that has sent fewer CAMs than this is the newcomer."""


class CamSurroundingsCue(Cue):
    """How deep a new station stands in a known one or in the vehicle itself, and how near it appears."""

    needs = (EvidenceKind.MESSAGES, EvidenceKind.ESTIMATE)
    relies_on_own_place = True
    meaning = "CAMs against other stations and the vehicle's own place"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._config = DetectorConfig()
        self._counts: dict[int, int] = {}
        self._last_ns: dict[int, int] = {}
        self._first_ns: int | None = None

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        if self._first_ns is None:
            self._first_ns = situation.time_ns
        is_settled = situation.time_ns - self._first_ns > self._config.settle_s * 1e9
        for heard in situation.claims:
            claim = heard.claim
            if not claim.is_cam or claim.x_m != claim.x_m:
                continue
            value, words = self._overlap(claim, situation)
            if is_settled and claim.station_id not in self._counts and not claim.may_be_known:
                near_m = appearance_m(claim, situation.receiver, self._config.earshot_m)
                ratio = near_m / THRESHOLDS["appearance"]
                if ratio > value:
                    away_m = claimed_range_m(claim, situation.receiver)
                    value, words = ratio, f"it is heard for the first time {away_m:.0f} m away"
            self._counts[claim.station_id] = self._counts.get(claim.station_id, 0) + 1
            self._last_ns[claim.station_id] = claim.arrival_ns
            yield CueReading(station(heard.station_id), claim.arrival_ns, value, words)
        self._forget(situation.time_ns)

    def _overlap(self, claim: Claim, situation: Situation) -> tuple[float, str]:
        box = claimed_box(claim, claim.arrival_ns)
        if box is None:
            return 0.0, ""
        apart_m, threshold = self._config.expectation.apart_m, THRESHOLDS["overlap"]
        me = situation.receiver
        own = (me.x_m, me.y_m, 0.0, me.length_m, me.width_m, 1.0, me.yaw_rad)
        share = overlap_share(box, [own], apart_m) / threshold if me.x_m == me.x_m else 0.0
        words = f"it claims to stand in this vehicle ({100 * share * threshold:.0f} % of its box)"
        mine = self._counts.get(claim.station_id, 0)
        for number, other in situation.around.items():
            if number == claim.station_id or self._counts.get(number, 0) <= max(mine, FAMILIAR_CLAIMS):
                continue
            if abs(other.x_m - claim.x_m) + abs(other.y_m - claim.y_m) > 2 * (
                claim.length_m + other.length_m
            ):
                continue
            theirs = claimed_box(other, claim.arrival_ns)
            found = 0.0 if theirs is None else overlap_share(box, [theirs], apart_m) / threshold
            if found > share:
                share, words = found, f"it claims to stand in station {number}"
        return share, words

    def _forget(self, now_ns: int) -> None:
        old = [n for n, last_ns in self._last_ns.items() if now_ns - last_ns > MEMORY_S * 1e9]
        for number in old:
            del self._last_ns[number], self._counts[number]
