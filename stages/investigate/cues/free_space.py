"""LiDAR against messages: a vehicle is claimed where rays pass through, and nothing stands near by."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.misbehaviour.checks import claimed_box
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.stages.investigate.cue import Cue, CueReading, FreeSpacePicture, Suspect, station
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.judged_scan import JudgedScan
from advpipe.stages.investigate.seen_vehicles import SeenVehicles
from advpipe.stages.investigate.sight import SeenBox, seen_boxes
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

SHOWN_M, MOST_SHOWN, MOST_RAYS_SHOWN = 30.0, 1500, 40

CLOUDS = 3
"""So many clouds, the last ones with the claimed place in sight, have to see through a vehicle: one of dark
paint, far away or half hidden, returns nothing now and then."""
LEAST_ERROR_M = 1.0
"""Of a claimed place as the vehicle sees it: of both GNSS, and of the motion since the claim."""
MOST_CLAIMED_M = 1.0
"""A station that claims to know its place less well is not excused the more."""
FORGET_NS = 1_000_000_000


class _Candidate(NamedTuple):
    """A claimed box on the map. claim: of a CAM; None for an object of a CPM."""

    suspect: Suspect
    what: str
    box: tuple[float, ...]
    claim: Claim | None = None


class FreeSpaceCue(Cue):
    """How far the nearest thing that a LiDAR sees is from a claimed box that its rays pass through: in
    metres, and less where the vehicle knows its own place and heading less well.

    Zero where something stops the rays; no reading where the box is hidden or too far away. Claims of CAMs
    and objects of CPMs count alike; the suspect is who sent them. Of a CAM's claims the least of the last
    `CLOUDS` clouds with the place in sight counts. Who moves on as when the LiDAR saw it a moment ago is not
    accused: of that, `lidar-tracks` speaks.
    """

    needs = (EvidenceKind.CLOUDS, EvidenceKind.MESSAGES, EvidenceKind.ESTIMATE, EvidenceKind.MOUNTS)
    relies_on_own_place = True
    meaning = "claimed vehicles against what LiDARs see through"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._tracks = SeenVehicles()
        self._gaps: dict[tuple[str, int], deque[tuple[int, float]]] = {}

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            map_SE3_base = situation.map_SE3_base(scan.time_ns)
            if map_SE3_base is None or scan.base_SE3_lidar is None:
                continue
            self._tracks.forget(scan.time_ns)
            found = list(_candidates(situation, scan))
            sights = seen_boxes([one.box for one in found], scan, map_SE3_base)
            for one, seen in zip(found, sights, strict=True):
                number = one.suspect.station_id
                if seen is None or number is None:
                    continue
                if one.claim is not None and seen.gap_m is None:
                    self._tracks.see(number, one.claim, scan.time_ns)
                elif one.claim is not None and self._tracks.is_on_track(number, one.claim, scan.time_ns):
                    continue
                error_m = _error_m(one, seen, situation)
                value = (seen.gap_m or 0.0) * LEAST_ERROR_M / error_m
                if one.claim is not None:
                    value = self._least(scan, number, value)
                yield _reading(one, seen, scan, value)
            self._forget(scan.time_ns)

    def _least(self, scan: JudgedScan, number: int, value: float) -> float:
        """The least of the newest values of a station; 0 before there are enough."""
        newest = self._gaps.setdefault((scan.name, number), deque(maxlen=CLOUDS))
        newest.append((scan.time_ns, value))
        is_full = len(newest) == CLOUDS and scan.time_ns - newest[0][0] <= CLOUDS * FORGET_NS
        return min(each for _, each in newest) if is_full else 0.0

    def _forget(self, now_ns: int) -> None:
        self._gaps = {key: one for key, one in self._gaps.items() if now_ns - one[-1][0] <= FORGET_NS}


def _error_m(one: _Candidate, seen: SeenBox, situation: Situation) -> float:
    """One standard deviation of where a claimed place lies in the LiDAR's sight, by what both state."""
    pose = situation.pose
    own_m, turned_m = (0.0, 0.0) if pose is None else (pose.place_stddev_m, pose.yaw_stddev_rad * seen.away_m)
    claimed_m = 0.0 if one.claim is None else min(one.claim.position_m / 2, MOST_CLAIMED_M)
    return max(LEAST_ERROR_M, math.hypot(own_m, turned_m, claimed_m))


def _candidates(situation: Situation, scan: JudgedScan) -> Iterator[_Candidate]:
    for number, claim in situation.around.items():
        box = claimed_box(claim, scan.time_ns)
        if box is not None:
            yield _Candidate(station(number), "the vehicle that it claims to be", box, claim)
    for one in situation.heard:
        x_m, y_m = one.moved_m(scan.time_ns)
        box = (x_m, y_m, 0.0, one.length_m, one.width_m, 1.0, one.yaw_rad)
        if np.isfinite(box).all() and min(one.length_m, one.width_m) > 1.0:
            yield _Candidate(station(one.station_id), "a vehicle that its CPM reports", box)


def _reading(one: _Candidate, seen: SeenBox, scan: JudgedScan, value: float) -> CueReading:
    if seen.gap_m is None:
        return CueReading(one.suspect, scan.time_ns, 0.0, f"{scan.name} sees {one.what}")
    words = (
        f"{seen.behind} of {len(seen.frustum.range_m)} rays of {scan.name} pass through {one.what}, "
        f"{seen.away_m:.0f} m away, "
    ) + (
        f"and nothing stands within {seen.gap_m:.1f} m of it"
        if seen.gap_m > 0
        else "though something is there"
    )
    picture = _picture(seen, scan) if seen.gap_m > 0 else None
    return CueReading(one.suspect, scan.time_ns, value, words, picture)


def _picture(seen: SeenBox, scan: JudgedScan) -> FreeSpacePicture:
    assert scan.base_SE3_lidar is not None
    in_base, frustum = seen.in_base, seen.frustum
    corners_m = box_corners(in_base[None])[0, :4, :2]
    near = np.abs(scan.base_points_m[:, :2] - in_base[:2]).max(axis=1) <= SHOWN_M
    shown = scan.base_points_m[near][:, :2]
    step = max(1, len(shown) // MOST_SHOWN)
    behind = np.flatnonzero(frustum.range_m > frustum.far_m)
    behind = behind[:: -(-len(behind) // MOST_RAYS_SHOWN)]
    in_box_m = frustum.origin + frustum.unit[behind] * frustum.range_m[behind, None]
    cos, sin = np.cos(in_base[6]), np.sin(in_base[6])
    ends_m = in_box_m[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + in_base[:2]
    return FreeSpacePicture(
        shown[::step].astype(np.float32).astype(np.float64),
        ends_m,
        corners_m,
        scan.base_SE3_lidar[:2, 3],
    )
