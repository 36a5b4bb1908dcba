"""Rotation vectors and matrices, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from advpipe.pipeline.localisation.rotations import rotation, rotation_vector, skew


def test_agrees_with_scipy() -> None:
    rng = np.random.default_rng(0)
    vectors = rng.standard_normal((300, 3)) * np.geomspace(1e-12, 2.0, 300)[:, None]
    assert rotation(vectors) == pytest.approx(Rotation.from_rotvec(vectors).as_matrix(), abs=1e-14)
    assert rotation(np.zeros(3)) == pytest.approx(np.eye(3), abs=0)
    for vector in [*vectors, np.array([3.1, 0.0, 0.0]), np.array([0.0, -2.0, 2.4])]:
        back = rotation_vector(rotation(vector))
        assert back == pytest.approx(Rotation.from_matrix(rotation(vector)).as_rotvec(), abs=1e-9)


def test_a_quarter_turn_to_the_left() -> None:
    assert rotation([0, 0, np.pi / 2]) @ [1, 0, 0] == pytest.approx([0, 1, 0])


def test_skew_is_the_cross_product() -> None:
    a, b = np.array([1.0, 2.0, 3.0]), np.array([-4.0, 5.0, 0.5])
    assert skew(a) @ b == pytest.approx(np.cross(a, b))
