"""A LiDAR against itself: no more returns are missing anywhere than a moment ago, surface for surface."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.attack_detection.density import QUANTILE
from advpipe.stages.investigate.cue import Cue, CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

REMEMBERED, FEWEST = 30, 5
"""Clouds whose middle excess is the usual one: a sensor loses returns in patches, wet or dark ones."""


class LidarDensityCue(Cue):
    """The excess of missing returns in windows of 5 rings and 11 columns over that of the clouds before, in
    standard deviations."""

    needs = (EvidenceKind.CLOUDS,)
    meaning = "missing LiDAR returns against those of the clouds before"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._usual: dict[str, deque[float]] = {}

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            if scan.sensor is None or (image := scan.image) is None or not len(scan.cloud):
                continue
            excess = scan.sensor.losses.excess(image)
            highest = float(np.quantile(excess, QUANTILE))
            before = self._usual.setdefault(scan.name, deque(maxlen=REMEMBERED))
            before.append(highest)
            if len(before) < FEWEST:
                continue
            value = highest - float(np.median(before))
            column = int(np.argmax(excess.max(axis=0)))
            turn = (column + scan.sensor.geometry.phase) / scan.sensor.geometry.columns
            left_deg = (360 * turn + 180) % 360 - 180
            words = (
                f"more of its returns are missing than before ({value:.1f} standard deviations), "
                f"most at {abs(left_deg):.0f}° to the {'left' if left_deg >= 0 else 'right'}"
            )
            yield CueReading(Suspect(scan.name), scan.time_ns, max(value, 0.0), words)
