"""Unreal's geometry: left-handed, x forward, y right, z up; yaw clockwise from above; metres and degrees."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

RADIUS_M = 0.9996 * 6378137.0
"""Of 0.9.16's projection, a spherical transverse Mercator."""


def matrix_of(pose: Any) -> np.ndarray:
    """The transform (4, 4) of x, y, z, pitch, yaw, roll: first roll, then pitch, then yaw."""
    pitch, yaw, roll = np.radians(np.asarray(pose[3:], dtype=np.float64))
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    about_y = np.array(
        [[math.cos(pitch), 0, -math.sin(pitch)], [0, 1, 0], [math.sin(pitch), 0, math.cos(pitch)]]
    )
    about_x = np.array([[1, 0, 0], [0, math.cos(roll), math.sin(roll)], [0, -math.sin(roll), math.cos(roll)]])
    matrix = np.eye(4)
    matrix[:3, :3] = about_z @ about_y @ about_x
    matrix[:3, 3] = pose[:3]
    return matrix


def pose_of(matrix: np.ndarray) -> np.ndarray:
    """The inverse of `matrix_of` (6,)."""
    pitch = math.asin(float(np.clip(matrix[2, 0], -1, 1)))
    yaw, roll = math.atan2(matrix[1, 0], matrix[0, 0]), math.atan2(-matrix[2, 1], matrix[2, 2])
    return np.array([*matrix[:3, 3], *np.degrees([pitch, yaw, roll])])


def mirrored(matrix: np.ndarray) -> np.ndarray:
    """A transform with the y axis to the left instead."""
    sign = np.diag([1.0, -1.0, 1.0, 1.0])
    return sign @ matrix @ sign


def geographic(place_m: Any, origin_deg: tuple[float, float], flips: bool) -> list[float]:
    """Latitude, longitude and height of a place, as the client's own `transform_to_geolocation`.

    The client lets latitude grow with y, which is to the south; `flips`: a server that does not.
    """
    east, north = place_m[0] / RADIUS_M, (-1 if flips else 1) * place_m[1] / RADIUS_M
    north += math.radians(origin_deg[0])
    latitude = math.asin(math.sin(north) / math.cosh(east))
    longitude = math.atan2(math.sinh(east), math.cos(north))
    return [math.degrees(latitude), origin_deg[1] + math.degrees(longitude), float(place_m[2])]
