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

REMEMBERED, FEWEST = 15, 5
"""Clouds whose middle share of holes is the usual one: a second and a half at 10 Hz."""
WANDER = 0.05
"""By what share of itself the usual number changes while the vehicle drives on, one standard deviation."""
STRANGE, LONGEST_STRANGE = 2.2, 100
"""A cloud so many standard deviations off is not remembered, unless as many in a row are."""


class LidarTemporalCue(Cue):
    """How many more rays vanish from the middle of bright surfaces than just before, in standard deviations.

    Weather and a sensor's own losses make holes in every cloud, about as many in the next.
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
            found = surface_holes(image)
            holes, rays = int(found.holes.sum()), int(found.surface.sum())
            sigmas, expected = usual.compared(holes, rays)
            if math.isfinite(sigmas):
                words = (
                    f"{holes} of {rays:,} rays vanish from the middle of bright surfaces, "
                    f"where the clouds before let expect {expected:.0f}"
                )
                yield CueReading(Suspect(scan.name), scan.time_ns, max(sigmas, 0.0), words)


class _UsualHoles:
    """The shares of holes in the last clouds that were not strange."""

    def __init__(self) -> None:
        self._shares: deque[float] = deque(maxlen=REMEMBERED)
        self._strange = 0

    def compared(self, holes: int, rays: int) -> tuple[float, float]:
        """By how many standard deviations a number of holes is above the expected one, and that; NaN while
        unknown. rays: that see such surfaces."""
        share = holes / max(rays, 1)
        if len(self._shares) < FEWEST:
            self._shares.append(share)
            return math.nan, math.nan
        expected = float(np.median(self._shares)) * rays
        sigmas = (holes - expected) / math.sqrt(expected + (WANDER * expected) ** 2 + 1)
        self._strange = self._strange + 1 if sigmas > STRANGE else 0
        if self._strange > LONGEST_STRANGE:
            self._shares.clear()
            self._strange = 0
        if sigmas <= STRANGE:
            self._shares.append(share)
        return sigmas, expected
