"""Conversion of vehicle poses between SUMO (front bumper) and advpipe (ground below the middle)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64


def base_poses(
    front_m: npt.ArrayLike, angle_deg: npt.ArrayLike, slope_deg: npt.ArrayLike, length_m: npt.ArrayLike
) -> Float64:
    """`map_SE3_base` (N, 4, 4) of vehicles from SUMO's values.

    front_m (N, 3): middle of the front bumper on the road. angle_deg (N,): clockwise from north.
    slope_deg (N,): upward positive. length_m (N,).
    """
    yaw = np.deg2rad(90.0 - np.asarray(angle_deg, dtype=np.float64))
    pitch = -np.deg2rad(np.asarray(slope_deg, dtype=np.float64))
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    poses = np.zeros((len(yaw), 4, 4))
    poses[:, 0, :3] = np.stack([cy * cp, -sy, cy * sp], axis=1)
    poses[:, 1, :3] = np.stack([sy * cp, cy, sy * sp], axis=1)
    poses[:, 2, :3] = np.stack([-sp, np.zeros_like(cp), cp], axis=1)
    back_m = np.asarray(length_m, dtype=np.float64)[:, None] / 2 * poses[:, :3, 0]
    poses[:, :3, 3] = np.asarray(front_m, dtype=np.float64).reshape(-1, 3) - back_m
    poses[:, 3, 3] = 1.0
    return poses


def front_of(map_SE3_base: Float64, length_m: float) -> tuple[Float64, float, float]:
    """The inverse for one vehicle: front bumper (3,), SUMO's angle in degrees, slope in degrees."""
    forward = map_SE3_base[:3, 0]
    angle_deg = 90.0 - np.rad2deg(np.arctan2(forward[1], forward[0]))
    slope_deg = np.rad2deg(np.arctan2(forward[2], np.hypot(forward[0], forward[1])))
    front_m: Float64 = map_SE3_base[:3, 3] + forward * length_m / 2
    return front_m, float(angle_deg % 360.0), float(slope_deg)
