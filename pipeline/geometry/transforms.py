"""Rigid transforms as (4, 4) float64 matrices, named `destination_SE3_source`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]


def se3(rotation: npt.ArrayLike, translation_m: npt.ArrayLike) -> Float64:
    """The transform (4, 4) with a rotation (3, 3) and a translation (3,) in metres."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation_m
    return matrix


def se3_from_yaw(translation_m: Sequence[float] | Float64, yaw_rad: float, pitch_rad: float = 0.0) -> Float64:
    """The pose (4, 4) at `translation_m` (3,) with a yaw and a pitch; a positive pitch is down (REP-103)."""
    cy, sy, cp, sp = math.cos(yaw_rad), math.sin(yaw_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    x_m, y_m, z_m = translation_m
    return np.array(
        [
            [cy * cp, -sy, cy * sp, x_m],
            [sy * cp, cy, sy * sp, y_m],
            [-sp, 0.0, cp, z_m],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def invert(a_SE3_b: Float64) -> Float64:
    """The inverse transform `b_SE3_a` (4, 4)."""
    rotation = a_SE3_b[:3, :3].T
    return se3(rotation, -rotation @ a_SE3_b[:3, 3])


def transform_points(a_SE3_b: Float64, points_b: npt.ArrayLike) -> Float64:
    """Transform points (..., 3) from frame b to frame a, as float64."""
    return np.asarray(points_b, dtype=np.float64) @ a_SE3_b[:3, :3].T + a_SE3_b[:3, 3]


def se3_from_tilt(tilt_rad: float, axis_rad: float) -> Float64:
    """The turn (4, 4) by `tilt_rad` about a level axis, `axis_rad` from x towards y (Rodrigues' formula)."""
    x, y = np.cos(axis_rad), np.sin(axis_rad)
    across = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(tilt_rad) * across + (1 - np.cos(tilt_rad)) * across @ across
    return se3(turn, (0.0, 0.0, 0.0))


def yaw_of(a_SE3_b: Float64) -> float:
    """The heading in radians, in (-pi, pi], of frame b's x axis in the x-y plane of frame a."""
    return float(np.arctan2(a_SE3_b[1, 0], a_SE3_b[0, 0]))


def wrap_angle(angle_rad: npt.ArrayLike) -> Float64:
    """The equivalent angle in [-pi, pi), for an angle or an array of any shape."""
    return (np.asarray(angle_rad, dtype=np.float64) + np.pi) % (2 * np.pi) - np.pi


def quaternion_xyzw(a_SE3_b: Float64) -> Float64:
    """The rotation as a unit quaternion (4,) in ROS order x, y, z, w, with w >= 0.

    It starts from the largest component to avoid a division by a small number (Shepperd, J. Guidance and
    Control 1(3), 1978). Python floats are used since they are faster than numpy for one matrix.
    """
    return np.array(quaternion_of_rows(a_SE3_b[:3, :3].tolist()))


def quaternion_of_rows(rows: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """As `quaternion_xyzw`, from the first three numbers of three rows."""
    (xx, xy, xz, *_), (yx, yy, yz, *_), (zx, zy, zz, *_), *_ = rows
    trace = xx + yy + zz
    largest = max(xx, yy, zz, trace)
    if largest == trace:
        parts = (zy - yz, xz - zx, yx - xy, 1 + trace)
    elif largest == xx:
        parts = (1 - trace + 2 * xx, yx + xy, xz + zx, zy - yz)
    elif largest == yy:
        parts = (yx + xy, 1 - trace + 2 * yy, zy + yz, xz - zx)
    else:
        parts = (xz + zx, zy + yz, 1 - trace + 2 * zz, yx - xy)
    norm = math.copysign(math.hypot(*parts), parts[3])
    x, y, z, w = parts
    return x / norm, y / norm, z / norm, w / norm


def se3_from_quaternion(xyzw: npt.ArrayLike, translation_m: npt.ArrayLike) -> Float64:
    """The transform (4, 4) with a quaternion (4,) in ROS order x, y, z, w and a translation (3,) in metres.

    Raises ValueError for a quaternion of length zero.
    """
    return se3(rotations_from_quaternions(xyzw), translation_m)


def rotations_from_quaternions(xyzw: npt.ArrayLike) -> Float64:
    """The rotation matrices (3, 3) or (N, 3, 3) of a quaternion (4,) or (N, 4) in ROS order x, y, z, w.

    Raises ValueError for a quaternion of length zero.
    """
    from scipy.spatial.transform import Rotation

    matrices: Float64 = Rotation.from_quat(np.asarray(xyzw, dtype=np.float64)).as_matrix()
    return matrices
