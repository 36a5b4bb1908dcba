"""A LiDAR against its own earlier clouds: surfaces do not get holes from one cloud to the next."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.attack_detection.holes import surface_holes
from advpipe.stages.investigate.cue import Cue, CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

REMEMBERED = 8
"""Clouds whose middle number of holes is the usual one: nearly a second at 10 Hz."""
FEWEST = 5
WANDER = 0.1
"""By what share of itself the usual number changes while the vehicle drives on, one standard deviation."""
STRANGE, LONGEST_STRANGE = 2.2, 100
"""A cloud so many standard deviations off is not remembered, unless as many in a row are."""


class LidarTemporalCue(Cue):
    """How many more rays vanish from the middle of surfaces than just before, in standard deviations.

    Weather, dark paint and a sensor's own losses make holes in every cloud, about as many in the next.
    """

    needs = (EvidenceKind.CLOUDS,)
    meaning = "holes in surfaces against the LiDAR's earlier clouds"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._usual: dict[str, _UsualHoles] = {}

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            if (image := scan.image) is None or not len(scan.cloud):
                continue
            usual = self._usual.setdefault(scan.name, _UsualHoles())
            holes = int(surface_holes(image).sum())
            sigmas, middle = usual.compared(holes)
            if math.isfinite(sigmas):
                words = (
                    f"{holes} rays vanish from the middle of surfaces, and {middle:.0f} in the clouds before"
                )
                yield CueReading(Suspect(scan.name), scan.time_ns, max(sigmas, 0.0), words)


class _UsualHoles:
    """The numbers of holes in the last clouds that were not strange."""

    def __init__(self) -> None:
        self._counts: deque[int] = deque(maxlen=REMEMBERED)
        self._strange = 0

    def compared(self, holes: int) -> tuple[float, float]:
        """By how many standard deviations a number is above the usual one, and that; NaN while unknown."""
        if len(self._counts) < FEWEST:
            self._counts.append(holes)
            return math.nan, math.nan
        middle = float(np.median(self._counts))
        sigmas = (holes - middle) / math.sqrt(middle + (WANDER * middle) ** 2 + 1)
        self._strange = self._strange + 1 if sigmas > STRANGE else 0
        if self._strange > LONGEST_STRANGE:
            self._counts.clear()
            self._strange = 0
        if sigmas <= STRANGE:
            self._counts.append(holes)
        return sigmas, middle
