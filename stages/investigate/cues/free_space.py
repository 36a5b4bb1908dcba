"""LiDAR against messages: a vehicle is claimed where rays pass through, and nothing stands near by."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.attack_detection.box_frustum import BoxFrustum, box_frustums
from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points, yaw_of
from advpipe.pipeline.misbehaviour.checks import claimed_box
from advpipe.stages.investigate.cue import Cue, CueReading, FreeSpacePicture, Suspect, station
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.judged_scan import JudgedScan
from advpipe.stages.investigate.situation import Situation

NEAREST_M, FARTHEST_M = 4.0, 45.0
CORE = 0.7
"""Share of the claimed size that rays have to pass through: places and sizes are not exact."""
PLACE_M = 0.3
"""Error of a claimed place, along a ray."""
BODY_M = (0.4, 1.3)
"""Heights above the ground between which every car stops rays."""
FEWEST_RAYS, FREE_SHARE = 6, 0.8
"""The space is free where so many returns, and this share of those through the core, lie behind it."""
OBJECT_M = (0.35, 2.5)
"""Heights of returns from vehicles rather than from the ground or from what hangs above."""
FARTHEST_GAP_M = 8.0
NTH_NEAREST = 3
"""A single return may be of anything; the third nearest says where something stands."""
SHOWN_M, MOST_SHOWN, MOST_RAYS_SHOWN = 30.0, 1500, 40


class _Candidate(NamedTuple):
    """A claimed box (7,) in the vehicle's frame and in the LiDAR's."""

    suspect: Suspect
    what: str
    in_base: Float64
    in_lidar: Float64


class FreeSpaceCue(Cue):
    """How far the nearest thing that a LiDAR sees is from a claimed box that its rays pass through.

    Zero where something stops the rays; no reading where the box is hidden or too far away. Claims of CAMs
    and objects of CPMs count alike; the suspect is who sent them.
    """

    needs = (EvidenceKind.CLOUDS, EvidenceKind.MESSAGES, EvidenceKind.ESTIMATE, EvidenceKind.MOUNTS)
    relies_on_own_place = True
    meaning = "claimed vehicles against what LiDARs see through"

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        for scan in situation.scans:
            map_SE3_base = situation.map_SE3_base(scan.time_ns)
            if map_SE3_base is None or scan.base_SE3_lidar is None or not len(scan.points_m):
                continue
            found = list(_candidates(situation, scan, invert(map_SE3_base)))
            if not found:
                continue
            height_m = scan.base_points_m[:, 2]
            things_m = scan.base_points_m[(height_m > OBJECT_M[0]) & (height_m < OBJECT_M[1]), :2]
            cores = np.array([one.in_lidar for one in found])
            cores[:, 3:5] *= CORE
            for one, frustum in zip(found, box_frustums(scan.points_m, cores), strict=True):
                reading = _reading(one, frustum, scan, things_m)
                if reading is not None:
                    yield reading


def _candidates(situation: Situation, scan: JudgedScan, base_SE3_map: Float64) -> Iterator[_Candidate]:
    for number, claim in situation.around.items():
        box = claimed_box(claim, scan.time_ns)
        if box is not None:
            yield from _placed(station(number), "the vehicle that it claims to be", box, scan, base_SE3_map)
    for one in situation.heard:
        x_m, y_m = one.moved_m(scan.time_ns)
        box = (x_m, y_m, 0.0, one.length_m, one.width_m, 1.0, one.yaw_rad)
        if np.isfinite(box).all() and min(one.length_m, one.width_m) > 1.0:
            yield from _placed(
                station(one.station_id), "a vehicle that its CPM reports", box, scan, base_SE3_map
            )


def _placed(
    suspect: Suspect, what: str, box: tuple[float, ...], scan: JudgedScan, base_SE3_map: Float64
) -> Iterator[_Candidate]:
    """The box around its body where it is neither the vehicle itself nor out of sight."""
    assert scan.base_SE3_lidar is not None
    x_m, y_m, _ = transform_points(base_SE3_map, [box[0], box[1], 0.0]).tolist()
    if not NEAREST_M <= np.hypot(x_m, y_m) <= FARTHEST_M or min(box[3:5]) <= 0:
        return
    low_m, high_m = BODY_M
    yaw_rad = box[6] + yaw_of(base_SE3_map)
    in_base = np.array([x_m, y_m, (low_m + high_m) / 2, box[3], box[4], high_m - low_m, yaw_rad])
    lidar_SE3_base = invert(scan.base_SE3_lidar)
    centre = transform_points(lidar_SE3_base, in_base[:3])
    in_lidar = np.array([*centre, *in_base[3:6], yaw_rad + yaw_of(lidar_SE3_base)])
    yield _Candidate(suspect, what, in_base, in_lidar)


def _reading(one: _Candidate, frustum: BoxFrustum, scan: JudgedScan, things_m: Float64) -> CueReading | None:
    rays = len(frustum.range_m)
    shell_m = (1 - CORE) / 2 * float(np.hypot(*one.in_lidar[3:5])) + PLACE_M
    reached = int((frustum.range_m >= frustum.near_m - shell_m).sum())  # the vehicle's own outside counts
    if reached < FEWEST_RAYS or reached < rays / 2:  # hidden, at least by half
        return None
    behind = frustum.range_m > frustum.far_m
    if behind.sum() < FREE_SHARE * reached:
        return CueReading(one.suspect, scan.time_ns, 0.0, f"{scan.name} sees {one.what}")
    gap_m = _gap_m(one.in_base, things_m)
    away_m = float(np.hypot(one.in_base[0], one.in_base[1]))
    words = (
        f"{int(behind.sum())} of {rays} rays of {scan.name} pass through {one.what}, {away_m:.0f} m away, "
        + (f"and nothing stands within {gap_m:.1f} m of it" if gap_m > 0 else "though something is there")
    )
    return CueReading(
        one.suspect, scan.time_ns, gap_m, words, _picture(one, frustum, scan) if gap_m > 0 else None
    )


def _gap_m(box: Float64, things_m: Float64) -> float:
    """From the box to the third nearest return that is neither ground nor sky."""
    turn = np.array([[np.cos(box[6]), -np.sin(box[6])], [np.sin(box[6]), np.cos(box[6])]])
    beyond_m = np.abs((things_m - box[:2]) @ turn) - box[3:5] / 2
    away_m = np.hypot(*np.maximum(beyond_m, 0.0).T)
    if len(away_m) < NTH_NEAREST:
        return FARTHEST_GAP_M
    return min(float(np.partition(away_m, NTH_NEAREST - 1)[NTH_NEAREST - 1]), FARTHEST_GAP_M)


def _picture(one: _Candidate, frustum: BoxFrustum, scan: JudgedScan) -> FreeSpacePicture:
    assert scan.base_SE3_lidar is not None
    corners_m = box_corners(one.in_base[None])[0, :4, :2]
    near = np.abs(scan.base_points_m[:, :2] - one.in_base[:2]).max(axis=1) <= SHOWN_M
    shown = scan.base_points_m[near][:, :2]
    step = max(1, len(shown) // MOST_SHOWN)
    behind = np.flatnonzero(frustum.range_m > frustum.far_m)
    behind = behind[:: -(-len(behind) // MOST_RAYS_SHOWN)]
    in_box_m = frustum.origin + frustum.unit[behind] * frustum.range_m[behind, None]
    cos, sin = np.cos(one.in_base[6]), np.sin(one.in_base[6])
    ends_m = in_box_m[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + one.in_base[:2]
    return FreeSpacePicture(
        shown[::step].astype(np.float32).astype(np.float64),
        ends_m,
        corners_m,
        scan.base_SE3_lidar[:2, 3],
    )
