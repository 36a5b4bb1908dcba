"""Chamfer distance: Eq. 4 by hand, by brute force and by scipy."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.metrics.chamfer import chamfer_distance


def brute_force(a, b):
    squared = cdist(np.asarray(a, np.float64), np.asarray(b, np.float64), "sqeuclidean")
    return squared.min(axis=1).mean() + squared.min(axis=0).mean()


def test_a_moved_point_counts_in_both_directions():
    # one of two points moved by 3 m: 9 / 2 from each side
    a, b = [[0, 0, 0], [100, 0, 0]], [[0, 0, 0], [100, 3, 0]]
    assert chamfer_distance(a, b) == 9.0


def test_a_removed_point_counts_in_one_direction():
    # the removed point is 2 m from the one that stays: 4 / 2 + 0
    assert chamfer_distance([[0, 0, 0], [2, 0, 0]], [[0, 0, 0]]) == 2.0
    assert chamfer_distance([[0, 0, 0]], [[0, 0, 0], [2, 0, 0]]) == 2.0


def test_moving_all_points_by_eps_gives_twice_eps_squared():
    grid = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)
    assert chamfer_distance(grid, grid + [0.0, 0.0, 0.1]) == pytest.approx(2 * 0.1**2)


def test_same_cloud_in_another_order_is_zero():
    points = np.random.default_rng(0).normal(size=(500, 3)).astype(np.float32)
    assert chamfer_distance(points, points[::-1]) == 0.0
    assert chamfer_distance(points, np.repeat(points, 2, axis=0)) == 0.0


@pytest.mark.oracle
@pytest.mark.parametrize("change", ["moved", "some moved", "removed", "added", "unrelated", "duplicates"])
def test_equals_brute_force(change):
    rng = np.random.default_rng(7)
    a = rng.normal(scale=10, size=(700, 3)).astype(np.float32)
    b = {
        "moved": a + rng.normal(scale=0.05, size=a.shape).astype(np.float32),
        "some moved": np.where(rng.random((700, 1)) < 0.1, a + np.float32(0.2), a),
        "removed": np.delete(a, rng.choice(700, 90, replace=False), axis=0),
        "added": np.concatenate([a, rng.normal(scale=10, size=(30, 3)).astype(np.float32)])[::-1],
        "unrelated": rng.normal(scale=10, size=(300, 3)).astype(np.float32),
        "duplicates": np.concatenate([a[:350], a[:350], -a[:3]]),
    }[change]
    assert chamfer_distance(a, b) == pytest.approx(brute_force(a, b), rel=1e-12)
    assert chamfer_distance(b, a) == pytest.approx(brute_force(b, a), rel=1e-12)
    assert chamfer_distance(a, b, workers=2) == chamfer_distance(a, b)


def test_signed_zeros_are_equal():
    assert chamfer_distance([[0.0, 0.0, 0.0], [1, 1, 1]], [[-0.0, 0.0, -0.0], [1, 1, 1]]) == 0.0


@pytest.mark.parametrize(("a", "b", "which"), [([], [[0, 0, 0]], "first"), ([[0, 0, 0]], [], "second")])
def test_empty_cloud_is_refused(a, b, which):
    with pytest.raises(AdvpipeError, match=f"{which} cloud .* has no points"):
        chamfer_distance(np.reshape(a, (-1, 3)), np.reshape(b, (-1, 3)))


def test_point_that_is_not_finite_is_refused():
    with pytest.raises(AdvpipeError, match="not finite"):
        chamfer_distance([[0, 0, 0]], [[np.nan, 0, 0]])
