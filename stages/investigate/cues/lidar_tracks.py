"""Tracks against detections: a vehicle that a LiDAR has seen does not vanish while nothing hides it."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.misbehaviour.checks import claimed_box
from advpipe.stages.investigate.cue import Cue, CueReading, Suspect
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.seen_vehicles import SeenVehicles
from advpipe.stages.investigate.sight import seen_boxes
from advpipe.stages.investigate.situation import PriorKnowledge, Situation


class LidarTracksCue(Cue):
    """How far the nearest thing is from where a track leads, of the track of which the LiDAR lost most.

    A track is a vehicle that was seen where its CAMs put it, in the last second. One whose station begins to
    lie about its place still stands where its track leads, so that this speaks against the LiDAR alone.
    """

    needs = (EvidenceKind.CLOUDS, EvidenceKind.MESSAGES, EvidenceKind.ESTIMATE, EvidenceKind.MOUNTS)
    relies_on_own_place = True
    meaning = "vehicles that a LiDAR has seen against what it sees now"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._tracks: dict[str, SeenVehicles] = {}

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            map_SE3_base = situation.map_SE3_base(scan.time_ns)
            if map_SE3_base is None or scan.base_SE3_lidar is None:
                continue
            tracks, time_ns = self._tracks.setdefault(scan.name, SeenVehicles()), scan.time_ns
            claims = {
                number: (claim, box)
                for number, claim in situation.around.items()
                if (box := claimed_box(claim, time_ns)) is not None
            }
            sights = seen_boxes([box for _, box in claims.values()], scan, map_SE3_base)
            found = {number for number, one in zip(claims, sights, strict=True) if one and one.gap_m is None}
            for number in found:
                tracks.see(number, claims[number][0], time_ns)
            expected = tracks.expected(time_ns)
            lost = [
                (one.gap_m, number, one.away_m)
                for number, one in zip(
                    expected, seen_boxes(list(expected.values()), scan, map_SE3_base), strict=True
                )
                if one is not None and one.gap_m is not None
            ]
            if lost:
                gap_m, number, away_m = max(lost)
                words = (
                    f"it no longer sees the vehicle of station {number}, which it saw a moment ago and which "
                    f"should stand {away_m:.0f} m away, nor anything within {gap_m:.1f} m of it"
                )
                yield CueReading(Suspect(scan.name), time_ns, gap_m, words)
            elif found:
                words = f"it sees {len(found)} vehicles where their CAMs put them"
                yield CueReading(Suspect(scan.name), time_ns, 0.0, words)
