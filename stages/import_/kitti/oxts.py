"""Poses from the GPS and inertial unit of raw drives (OXTS)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.kitti.number_lines import read_number_rows

EARTH_RADIUS_M = 6378137.0

_VALUES = 30
_FIX = "restore it from the drive's archive"


class OxtsPoses:
    """Poses of the inertial unit: x east, y north, z up, as KITTI's development kit computes them.

    It projects latitude and longitude by Mercator, with the scale of the first fix; positions here start at
    that fix.
    """

    def __init__(self, folder: Path, first: int) -> None:
        """folder: with data/NNNNNNNNNN.txt. first: number of the frame where positions start."""
        self._folder = folder
        values = self._values(first)
        self._scale = math.cos(math.radians(values[0]))
        self._origin_m = self._position(values)

    def map_SE3_imu(self, number: int) -> Float64:
        """The pose (4, 4) at a frame. Raises AdvpipeError for a missing or damaged file."""
        values = self._values(number)
        roll, pitch, yaw = values[3:6]
        return se3(_rotation(roll, pitch, yaw), self._position(values) - self._origin_m)

    def _position(self, values: Float64) -> Float64:
        latitude_deg, longitude_deg, altitude_m = values[:3]
        east_m = self._scale * EARTH_RADIUS_M * math.radians(longitude_deg)
        north_m = self._scale * EARTH_RADIUS_M * math.log(math.tan(math.radians(90 + latitude_deg) / 2))
        return np.array([east_m, north_m, altitude_m])

    def _values(self, number: int) -> Float64:
        file = self._folder / "data" / f"{number:010d}.txt"
        if not file.is_file():
            raise AdvpipeError(
                f"{file} is missing; {_FIX}, or remove the folder oxts to import without poses"
            )
        rows = read_number_rows(file, _VALUES, _FIX)
        if len(rows) != 1 or not abs(rows[0, 0]) < 90:
            raise AdvpipeError(f"{file}: does not hold one fix of {_VALUES} numbers; {_FIX}")
        values: Float64 = rows[0]
        return values


def _rotation(roll: float, pitch: float, yaw: float) -> Float64:
    """map_R_imu (3, 3): a roll about x, then a pitch about y, then a yaw about z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
