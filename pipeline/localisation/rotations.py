"""Rotation vectors and matrices: Solà 2017, "Quaternion kinematics for the error-state Kalman filter"."""

from __future__ import annotations

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
    from scipy.spatial.transform import Rotation

    vector: Float64 = Rotation.from_matrix(matrix).as_rotvec()
    return vector
