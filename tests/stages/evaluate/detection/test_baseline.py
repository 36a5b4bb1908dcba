"""The random baseline spends the attack's budget exactly."""

import numpy as np
import pytest

from advpipe.pipeline.bag.cloud import POINT_DTYPE, xyz
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.evaluate.detection.baseline import random_baseline
from advpipe.stages.evaluate.detection.cloud_difference import cloud_difference


def cloud(n: int = 400) -> np.ndarray:
    rng = np.random.default_rng(0)
    points = np.zeros(n, POINT_DTYPE)
    points["x"], points["y"], points["z"] = rng.uniform(-20, 20, (3, n))
    points["time"] = np.arange(n) * 1e-4
    return points


def of(after: np.ndarray, seed: int = 0) -> np.ndarray:
    change = cloud_difference(cloud(), after)
    return random_baseline(cloud(), after, change, Boxes(), np.random.default_rng(seed))


def test_removes_as_many_elsewhere():
    random = of(cloud()[10:])
    change = cloud_difference(cloud(), random)
    assert len(change.removed) == 10
    assert len(change.added) == 0
    assert change.removed.tolist() != list(range(10))


def test_moves_as_many_as_far():
    after = cloud()
    after["x"][:5] += np.array([0.1, 0.2, 0.3, 0.4, 0.5], np.float32)
    change, random = cloud_difference(cloud(), after), cloud_difference(cloud(), of(after))
    assert len(random.moved) == 5
    assert sorted(random.displacement_m) == pytest.approx(sorted(change.displacement_m), abs=1e-5)
    assert random.moved.tolist() != change.moved.tolist()


def test_adds_as_many_no_farther():
    added = cloud()[:7].copy()
    added["z"] += 0.5
    random = of(np.concatenate([cloud(), added]))
    change = cloud_difference(cloud(), random)
    assert len(change.added) == 7
    distance_m = np.linalg.norm(xyz(random[change.added])[:, None] - xyz(cloud())[None], axis=2).min(axis=1)
    assert (distance_m <= 0.5 + 1e-5).all()
    assert distance_m.max() > 0.05


def test_same_generator_same_cloud():
    after = cloud()[10:]
    assert (of(after) == of(after)).all()
    assert (of(after) != of(after, seed=1)).any()
