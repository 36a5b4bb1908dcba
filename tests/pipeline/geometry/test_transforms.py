"""Rotations against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from advpipe.pipeline.geometry.transforms import quaternion_xyzw, se3, se3_from_quaternion, se3_from_yaw


def test_quaternions_equal_those_of_scipy() -> None:
    """Random ones, and the half turns at which one formula after the other breaks down."""
    rotations = Rotation.random(2000, random_state=0).as_matrix()
    half_turns = Rotation.from_rotvec(np.pi * np.eye(3)).as_matrix()
    near = Rotation.from_rotvec((np.pi - 1e-9) * np.eye(3)).as_matrix()
    for rotation in (*rotations, *near):
        ours = quaternion_xyzw(se3(rotation, (0, 0, 0)))
        np.testing.assert_allclose(ours, Rotation.from_matrix(rotation).as_quat(canonical=True), atol=1e-12)
    for rotation in half_turns:
        ours = quaternion_xyzw(se3(rotation, (0, 0, 0)))
        assert abs(ours @ Rotation.from_matrix(rotation).as_quat()) == pytest.approx(1)


def test_a_transform_and_its_inverse_cancel() -> None:
    pose = se3_from_yaw((1.0, 2.0, 3.0), 2.5, -0.1)
    np.testing.assert_allclose(se3_from_quaternion(quaternion_xyzw(pose), (1, 2, 3)), pose, atol=1e-14)
