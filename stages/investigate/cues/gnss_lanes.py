"""GNSS against the map: a car drives on lanes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from advpipe.stages.investigate.cue import GNSS, Cue, CueReading
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

AVERAGED = 5
"""Fixes whose mean place is compared: half a second, so that white noise matters less."""

LEAST_MPS = 1.0
"""Who stands may stand beside the road."""


class GnssLanesCue(Cue):
    """How far the fixes lie beside the nearest lane while the vehicle drives."""

    needs = (EvidenceKind.FIXES, EvidenceKind.LANES, EvidenceKind.WHEELS)
    meaning = "GNSS fixes against the lanes of the map"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._places_m: list[tuple[float, float]] = []

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        geodesy, observed = self._background.geodesy, situation.observed
        if geodesy is None or not observed.fixes or not observed.twists:
            return
        self._places_m.append(geodesy.place_m(*observed.fixes[-1].geographic[:2].tolist()))
        if len(self._places_m) < AVERAGED:
            return
        x_m, y_m = np.mean(self._places_m, axis=0).tolist()
        self._places_m.clear()
        if abs(observed.twists[-1].speed_mps) < LEAST_MPS:
            return
        off_m, _ = self._background.roads.measure([(x_m, y_m, 0.0)])
        if np.isfinite(off_m[0]):
            words = f"the fixes lie {off_m[0]:.1f} m beside the nearest lane while the vehicle drives"
            yield CueReading(GNSS, situation.time_ns, float(off_m[0]), words)
