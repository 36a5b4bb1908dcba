from __future__ import annotations

import math

import numpy as np
import pytest

from advpipe.pipeline.v2x.facilities.cam import confidence_ellipse


@pytest.mark.parametrize(
    ("east_m", "north_m", "expected_rad"), [(2.0, 1.0, math.pi / 2), (1.0, 2.0, 0.0), (3.0, 3.0, None)]
)
def test_the_ellipse_is_exact_along_the_axes(
    east_m: float, north_m: float, expected_rad: float | None
) -> None:
    """2.4477 sigma hold 95 % in two dimensions."""
    major_m, minor_m, direction_rad = confidence_ellipse((east_m**2, 0.0, north_m**2))
    assert major_m == pytest.approx(2.4477 * max(east_m, north_m), rel=1e-4)
    assert minor_m == pytest.approx(2.4477 * min(east_m, north_m), rel=1e-4)
    if expected_rad is not None:
        assert direction_rad == pytest.approx(expected_rad)


def test_the_ellipses_axes_are_the_eigenvectors() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        root = rng.normal(size=(2, 2))
        covariance = root @ root.T
        major_m, minor_m, direction_rad = confidence_ellipse((*covariance[0], covariance[1, 1]))
        values, vectors = np.linalg.eigh(covariance)
        assert minor_m is not None
        assert major_m is not None
        assert direction_rad is not None
        np.testing.assert_allclose([minor_m, major_m], np.maximum(2.4477468 * np.sqrt(values), 0.01))
        axis = [math.sin(direction_rad), math.cos(direction_rad)]  # east, north of a compass direction
        assert abs(vectors[:, 1] @ axis) == pytest.approx(1)
        assert 0 <= direction_rad < math.pi


def test_the_ellipse_contains_95_percent() -> None:
    rng = np.random.default_rng(1)
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    major_m, minor_m, direction_rad = confidence_ellipse((4.0, 1.5, 1.0))
    assert direction_rad is not None
    errors = rng.multivariate_normal([0, 0], covariance, size=20_000)
    along = errors @ [math.sin(direction_rad), math.cos(direction_rad)]
    across = errors @ [math.cos(direction_rad), -math.sin(direction_rad)]
    assert np.mean((along / major_m) ** 2 + (across / minor_m) ** 2 <= 1) == pytest.approx(0.95, abs=0.005)


def test_certain_and_unknown_positions_are_coded() -> None:
    assert confidence_ellipse((0.0, 0.0, 0.0))[:2] == (0.01, 0.01)
    assert confidence_ellipse(None) == (None, None, None)
