"""The nearest points, beside distances to all of them."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.lengths import lengths
from advpipe.pipeline.geometry.nearest_points import WORTH_A_CHOICE, nearest_points


@pytest.mark.parametrize("points", [50, 2 * WORTH_A_CHOICE])
@pytest.mark.parametrize("about_m", [1e-3, 1.0, 1e3, None])
def test_they_are_the_nearest_of_all(points: int, about_m: float | None) -> None:
    rng = np.random.default_rng(1)
    many = rng.normal(scale=(30, 30, 1), size=(points, 3)).astype(np.float32)
    few = np.concatenate([rng.normal(scale=(30, 30, 1), size=(9, 3)), [[500.0, 0.0, 0.0]]])
    away_m = np.linalg.norm(few[:, None] - many.astype(np.float64), axis=2)
    distance_m, index = nearest_points(many, few, about_m)
    np.testing.assert_allclose(distance_m, away_m.min(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(index, away_m.argmin(axis=1))


def test_without_points_they_are_infinitely_far() -> None:
    distance_m, index = nearest_points(np.zeros((0, 3)), np.zeros((2, 3)))
    assert distance_m.tolist() == [np.inf, np.inf]
    assert index.tolist() == [0, 0]
    assert nearest_points(np.ones((3, 3)), np.zeros((0, 3)))[0].shape == (0,)


def test_lengths_are_those_of_numpy_to_the_last_bit() -> None:
    for dtype in (np.float32, np.float64):
        vectors = np.random.default_rng(2).normal(size=(10_000, 3)).astype(dtype)
        np.testing.assert_array_equal(lengths(vectors), np.linalg.norm(vectors, axis=1))
