"""CARLA's poses: left-handed (x forward, y right, z up), angles in degrees; here as right-handed ones.

Mirroring the y axis is exact: coordinates change their sign only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3

MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])


def se3_from_carla(pose: Sequence[float]) -> Float64:
    """The right-handed transform (4, 4) of a pose x, y, z in metres, roll, yaw, pitch in degrees.

    The rotation is `carla.Transform`'s, which OpenCOOD's `x_to_world` repeats, with the y axis mirrored.
    """
    x_m, y_m, z_m = pose[:3]
    roll, yaw, pitch = (math.radians(angle) for angle in pose[3:])
    cr, sr, cy, sy = math.cos(roll), math.sin(roll), math.cos(yaw), math.sin(yaw)
    cp, sp = math.cos(pitch), math.sin(pitch)
    rotation = [
        [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
        [sp, -cp * sr, cp * cr],
    ]
    matrix: Float64 = MIRROR @ se3(rotation, [x_m, y_m, z_m]) @ MIRROR
    return matrix


def carla_from_se3(a_SE3_b: Float64) -> list[float]:
    """The pose x, y, z in metres, roll, yaw, pitch in degrees of a right-handed transform (4, 4)."""
    matrix = MIRROR @ a_SE3_b @ MIRROR
    pitch = math.asin(min(1.0, max(-1.0, matrix[2, 0])))
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    roll = math.atan2(-matrix[2, 1], matrix[2, 2])
    return [*matrix[:3, 3].tolist(), *map(math.degrees, (roll, yaw, pitch))]
