"""A LiDAR against itself: a ray returns once, and no surface is seen through another."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.attack_detection.occlusion_order import seen_through
from advpipe.stages.investigate.cue import Cue, CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import Situation


class LidarOrderCue(Cue):
    """The number of rays, per thousand points, that return twice or that all rays around them stop before."""

    needs = (EvidenceKind.CLOUDS,)
    meaning = "LiDAR returns against the order of surfaces along a ray"

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            if (image := scan.image) is None or not len(scan.cloud):
                continue
            twice = int((image.count > 1).sum())
            through = int(seen_through(image.range_m).sum())
            words = f"{twice} rays return twice, and {through} returns lie behind all that surround them"
            yield CueReading(
                Suspect(scan.name), scan.time_ns, 1000 * (twice + through) / len(scan.cloud), words
            )
