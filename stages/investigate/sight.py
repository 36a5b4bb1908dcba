"""What a LiDAR sees of boxes in which vehicles should stand: something that stops its rays, or free space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.attack_detection.box_frustum import BoxFrustum, box_frustums
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points, yaw_of
from advpipe.stages.investigate.judged_scan import JudgedScan

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


@dataclass(frozen=True)
class SeenBox:
    """What a LiDAR sees of a box.

    in_base: (7,) in the vehicle's frame. frustum: the rays through its core. gap_m: how far the nearest thing
    stands from it where the rays pass through; None where something in it stops them.
    """

    in_base: Float64
    frustum: BoxFrustum
    gap_m: float | None

    @property
    def behind(self) -> int:
        """The number of rays that return from behind the box."""
        return int((self.frustum.range_m > self.frustum.far_m).sum())

    @property
    def away_m(self) -> float:
        """From the vehicle."""
        return float(np.hypot(self.in_base[0], self.in_base[1]))


def seen_boxes(
    boxes: Sequence[tuple[float, ...]], scan: JudgedScan, map_SE3_base: Float64
) -> list[SeenBox | None]:
    """What a scan shows of boxes on the map, as `claimed_box` gives them; None for one that is the vehicle's
    own, too far away, or hidden by half. The scan has a mount."""
    base_SE3_map = invert(map_SE3_base)
    placed = [_placed(box, scan, base_SE3_map) for box in boxes]
    cores = np.array([one[1] for one in placed if one is not None]).reshape(-1, 7)
    if not len(cores) or not len(scan.points_m):
        return [None] * len(boxes)
    cores[:, 3:5] *= CORE
    frustums = box_frustums(scan.points_m, cores)
    height_m = scan.base_points_m[:, 2]
    things_m = scan.base_points_m[(height_m > OBJECT_M[0]) & (height_m < OBJECT_M[1]), :2]
    return [None if one is None else _seen(one[0], next(frustums), things_m) for one in placed]


def _placed(
    box: tuple[float, ...], scan: JudgedScan, base_SE3_map: Float64
) -> tuple[Float64, Float64] | None:
    """The box around the body, in the vehicle's frame and in the LiDAR's."""
    assert scan.base_SE3_lidar is not None
    x_m, y_m, _ = transform_points(base_SE3_map, [box[0], box[1], 0.0]).tolist()
    if not NEAREST_M <= np.hypot(x_m, y_m) <= FARTHEST_M or min(box[3:5]) <= 0:
        return None
    low_m, high_m = BODY_M
    yaw_rad = box[6] + yaw_of(base_SE3_map)
    in_base = np.array([x_m, y_m, (low_m + high_m) / 2, box[3], box[4], high_m - low_m, yaw_rad])
    lidar_SE3_base = invert(scan.base_SE3_lidar)
    centre = transform_points(lidar_SE3_base, in_base[:3])
    return in_base, np.array([*centre, *in_base[3:6], yaw_rad + yaw_of(lidar_SE3_base)])


def _seen(in_base: Float64, frustum: BoxFrustum, things_m: Float64) -> SeenBox | None:
    shell_m = (1 - CORE) / 2 * float(np.hypot(*in_base[3:5])) + PLACE_M
    reached = int((frustum.range_m >= frustum.near_m - shell_m).sum())  # the vehicle's own outside counts
    if reached < FEWEST_RAYS or reached < len(frustum.range_m) / 2:  # hidden, at least by half
        return None
    behind = frustum.range_m > frustum.far_m
    is_free = behind.sum() >= FREE_SHARE * reached
    return SeenBox(in_base, frustum, _gap_m(in_base, things_m) if is_free else None)


def _gap_m(box: Float64, things_m: Float64) -> float:
    """From the box to the third nearest return that is neither ground nor sky."""
    turn = np.array([[np.cos(box[6]), -np.sin(box[6])], [np.sin(box[6]), np.cos(box[6])]])
    beyond_m = np.abs((things_m - box[:2]) @ turn) - box[3:5] / 2
    away_m = np.hypot(*np.maximum(beyond_m, 0.0).T)
    if len(away_m) < NTH_NEAREST:
        return FARTHEST_GAP_M
    return min(float(np.partition(away_m, NTH_NEAREST - 1)[NTH_NEAREST - 1]), FARTHEST_GAP_M)
