"""Power against claimed distance: who is far away is not heard so well."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.misbehaviour.checks import claimed_range_m
from advpipe.stages.investigate.cue import Cue, CueReading, station
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

FREE_SPACE_DB = 47.86
"""Loss of free space at one metre and 5.9 GHz."""

AVERAGED, FEWEST = 8, 4
"""Messages of a station whose mean power counts: fading changes with each."""

REFERENCE = 400
"""Messages of all stations from which the usual power is learnt; as many before anything is judged as would
make a quarter of it."""

USUAL_QUANTILE = 0.75
"""Walls and vehicles weaken signals, and nothing makes them stronger: most in free sight lie here."""


class PowerDistanceCue(Cue):
    """By how many decibels a station is received better than others of its claimed distance."""

    needs = (EvidenceKind.MESSAGES, EvidenceKind.RECEPTIONS, EvidenceKind.ESTIMATE)
    relies_on_own_place = True
    meaning = "power of received messages against claimed distances"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._all: deque[float] = deque(maxlen=REFERENCE)
        self._stations: dict[int, deque[float]] = {}

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        receiver = situation.receiver
        self._stations = {n: one for n, one in self._stations.items() if n in situation.around}
        usual_dbm = (
            float(np.quantile(self._all, USUAL_QUANTILE)) if len(self._all) >= REFERENCE / 4 else math.nan
        )
        for heard in situation.claims:
            away_m = claimed_range_m(heard.claim, receiver)
            if not (math.isfinite(away_m) and math.isfinite(heard.power_dbm)):
                continue
            at_sender_dbm = heard.power_dbm + FREE_SPACE_DB + 20 * math.log10(max(away_m, 5.0))
            self._all.append(at_sender_dbm)
            own = self._stations.setdefault(heard.station_id, deque(maxlen=AVERAGED))
            own.append(at_sender_dbm)
            if len(own) >= FEWEST and math.isfinite(usual_dbm):
                over_db = float(np.mean(own)) - usual_dbm
                words = f"its signal is {over_db:.0f} dB stronger than from the {away_m:.0f} m that it claims"
                yield CueReading(station(heard.station_id), heard.claim.arrival_ns, max(over_db, 0.0), words)
