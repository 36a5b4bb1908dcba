"""Rotation vectors and matrices: Solà 2017, "Quaternion kinematics for the error-state Kalman filter"."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64


def skew(vector: Float64) -> Float64:
    """The matrices (..., 3, 3) of the cross product with vectors (..., 3) from the left."""
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix


def rotation(vector_rad: npt.ArrayLike) -> Float64:
    """The matrices (..., 3, 3) of rotation vectors (..., 3): Rodrigues' formula (Solà 2.3.3)."""
    vectors = np.asarray(vector_rad, dtype=np.float64)
    square = np.sum(vectors * vectors, axis=-1)[..., None, None]
    angle = np.sqrt(square)
    small = square < 1e-12  # there the series is exact to rounding
    safe = np.where(small, 1.0, square)
    first = np.where(small, 1 - square / 6, np.sin(angle) / np.sqrt(safe))
    second = np.where(small, 0.5 - square / 24, (1 - np.cos(angle)) / safe)
    cross = skew(vectors)
    matrices: Float64 = np.eye(3) + first * cross + second * (cross @ cross)
    return matrices


def rotation_vector(matrix: Float64) -> Float64:
    """The rotation vector (3,), at most pi long, of a matrix (3, 3) (Solà 2.3.4)."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = matrix.tolist()
    doubled_sine = np.array([zy - yz, xz - zx, yx - xy])
    sine = math.sqrt(float(doubled_sine @ doubled_sine)) / 2
    cosine = (float(matrix.trace()) - 1) / 2
    if cosine < -0.9:  # near half a turn the sines say too little of the axis
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(matrix).as_rotvec())
    vector: Float64 = doubled_sine * (math.atan2(sine, cosine) / (2 * sine) if sine > 1e-9 else 0.5)
    return vector
