"""What was done to a cloud: moved, removed and added points, against counting in plain Python."""

from collections import Counter

import numpy as np
import pytest

from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.messages.cloud_difference import cloud_difference


def cloud(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    points = np.zeros(n, POINT_DTYPE)
    for field in ("x", "y", "z", "intensity", "time"):
        points[field] = rng.normal(size=n)
    points["ring"] = rng.integers(0, 64, n)
    return points


def test_same_cloud_has_no_difference():
    change = cloud_difference(cloud(50), cloud(50))
    assert len(change.removed) == len(change.added) == len(change.moved) == 0
    assert change.max_displacement_m == 0.0


def test_moved_points_and_how_far():
    after = cloud(50)
    after["x"][7], after["y"][7] = after["x"][7] + 3, after["y"][7] + 4
    after["z"][9] += 1
    change = cloud_difference(cloud(50), after)
    assert change.moved.tolist() == [7, 9]
    assert change.displacement_m == pytest.approx([5.0, 1.0], abs=1e-6)
    assert change.max_displacement_m == pytest.approx(5.0, abs=1e-6)
    assert len(change.removed) == len(change.added) == 0


def test_displacement_is_that_of_the_stored_numbers():
    before, after = cloud(1), cloud(1)
    before["x"], after["x"] = 100.0, np.float32(100.01)
    assert cloud_difference(before, after).displacement_m[0] == float(np.float32(100.01)) - 100.0


def test_removed_points():
    change = cloud_difference(cloud(50), np.delete(cloud(50), [3, 30]))
    assert change.removed.tolist() == [3, 30]
    assert len(change.added) == len(change.moved) == 0


def test_added_points_in_any_order():
    order = np.random.default_rng(1).permutation(53)
    after = np.concatenate([cloud(50), cloud(3, seed=9)])[order]
    change = cloud_difference(cloud(50), after)
    assert sorted(order[change.added]) == [50, 51, 52]
    assert len(change.removed) == len(change.moved) == 0


def test_as_many_removed_as_added_is_no_move():
    after = np.concatenate([cloud(50)[1:], cloud(1, seed=9)])
    change = cloud_difference(cloud(50), after)
    assert change.removed.tolist() == [0]
    assert change.added.tolist() == [49]


def test_copies_are_counted():
    twice = np.concatenate([cloud(5), cloud(5)[:2]])
    assert cloud_difference(cloud(5), twice).added.tolist() == [5, 6]
    assert cloud_difference(twice, cloud(5)).removed.tolist() == [5, 6]


@pytest.mark.parametrize("seed", range(5))
def test_multisets_as_plain_python_counts_them(seed):
    rng = np.random.default_rng(seed)
    kinds = cloud(12)
    before, after = kinds[rng.integers(0, 12, 60)], kinds[rng.integers(0, 12, 47)]
    change = cloud_difference(before, after)
    gone = Counter(p.tobytes() for p in before) - Counter(p.tobytes() for p in after)
    come = Counter(p.tobytes() for p in after) - Counter(p.tobytes() for p in before)
    assert Counter(p.tobytes() for p in before[change.removed]) == gone
    assert Counter(p.tobytes() for p in after[change.added]) == come


def test_empty_clouds():
    assert cloud_difference(cloud(0), cloud(0)).max_displacement_m == 0.0
    assert cloud_difference(cloud(4), cloud(0)).removed.tolist() == [0, 1, 2, 3]
    assert cloud_difference(cloud(0), cloud(2)).added.tolist() == [0, 1]
