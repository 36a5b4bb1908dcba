"""CAMs against themselves, the map and each other: the misbehaviour checks of `pipeline/misbehaviour`."""

from __future__ import annotations

import math
from collections.abc import Iterator

from advpipe.pipeline.misbehaviour.config import CHECKS, THRESHOLDS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import OnlineDetector
from advpipe.stages.investigate.cue import Cue, CueReading, station
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.manoeuvres import Manoeuvres
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

LEFT_OUT = frozenset({"branch", "overlap", "appearance", "range"})
"""The first only repeats an earlier verdict; the others depend on who else lies, or on the own place."""

MOST = 1e3


class CamPlausibilityCue(Cue):
    """The largest statistic of a check over its threshold, for each CAM; of checks that an honest manoeuvre
    fails (`manoeuvres.py`), none."""

    needs = (EvidenceKind.MESSAGES,)
    meaning = "CAMs against themselves and against the map"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._detector = OnlineDetector(DetectorConfig())
        self._manoeuvres = Manoeuvres()

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        receiver = situation.receiver
        for heard in situation.claims:
            statistics, _ = self._detector.judge(heard.claim, receiver)
            excused = LEFT_OUT | self._manoeuvres.excuses(heard.claim)
            ratio, name, statistic = max(
                (_ratio(value, THRESHOLDS[check]), check, value)
                for check, value in zip(CHECKS, statistics, strict=True)
                if check not in excused
            )
            yield CueReading(
                station(heard.station_id), heard.claim.arrival_ns, ratio, _words(name, statistic)
            )


def _ratio(value: float, threshold: float) -> float:
    return min(value / threshold, MOST) if not math.isnan(value) else 0.0


def _words(check: str, statistic: float) -> str:
    unit, meaning = CHECKS[check].unit, CHECKS[check].meaning
    shown = "" if unit == "1" else f": {statistic:.3g} {unit}" if math.isfinite(statistic) else ": at once"
    return f"its CAM fails the check of {check} ({meaning}{shown})"
