"""A LiDAR against itself: each return lies on a ray that the sensor fires."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.stages.investigate.cue import Cue, CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.situation import Situation


class LidarRaysCue(Cue):
    """The share of points, per thousand, that lie off the rays that the first clouds show."""

    needs = (EvidenceKind.CLOUDS,)
    meaning = "LiDAR points against the rays of the sensor"

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            if scan.sensor is None or not len(scan.cloud):
                continue
            off = int(scan.sensor.geometry.off_ray(scan.cloud).sum())
            words = f"{off:,} of its {len(scan.cloud):,} points lie off the rays that it fires"
            yield CueReading(Suspect(scan.name), scan.time_ns, 1000 * off / len(scan.cloud), words)
