from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from advpipe.pipeline.baselines import (
    add_random_points,
    move_within,
    random_directions,
    random_offsets,
    remove_random_points,
)
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import POINT_DTYPE, xyz


def cloud_of(count, scale_m=50.0, seed=1):
    rng = np.random.default_rng(seed)
    cloud = np.zeros(count, POINT_DTYPE)
    for name in ("x", "y", "z"):
        cloud[name] = rng.uniform(-scale_m, scale_m, count)
    cloud["ring"] = np.arange(count) % 64
    cloud["intensity"] = rng.random(count)
    return cloud


@pytest.mark.parametrize("count", [0, 1, 37, 100])
def test_remove_takes_exactly_the_count(count):
    kept = remove_random_points(cloud_of(100), count, np.random.default_rng(0))
    assert len(kept) == 100 - count
    assert (np.diff(kept) > 0).all()


def test_remove_is_uniform_over_the_points():
    rng, cloud = np.random.default_rng(0), cloud_of(20)
    hits = np.zeros(20)
    for _ in range(2000):
        hits[remove_random_points(cloud, 5, rng)] += 1
    assert chisquare(hits).pvalue > 0.01


def test_remove_same_seed_same_points():
    first, second = (remove_random_points(cloud_of(50), 9, np.random.default_rng(4)) for _ in range(2))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("scale_m", [1.0, 50.0, 1e5])
def test_move_within_never_exceeds_its_offset_and_is_nearly_exact(scale_m):
    start, rng = xyz(cloud_of(5000, scale_m)), np.random.default_rng(2)
    length = rng.uniform(0, 0.2, 5000)
    length[:10] = 0.0
    moved = move_within(start, random_directions(5000, rng) * length[:, None])
    distance = np.linalg.norm(moved.astype(np.float64) - start, axis=1)
    assert (distance <= length).all()
    assert (distance >= length - 2 * np.spacing(np.float32(scale_m))).all()
    assert np.array_equal(moved[:10], start[:10])


def test_directions_are_uniform_over_the_sphere():
    directions = random_directions(5000, np.random.default_rng(3))
    for axis in range(3):  # Archimedes: each coordinate of a uniform unit vector is uniform in [-1, 1]
        assert kstest(directions[:, axis], "uniform", args=(-1, 2)).pvalue > 0.01


def test_move_within_rounds_towards_the_start():
    start = np.float32([[1.0, -1.0, 0.0]])
    offset = np.array([[1e-9, -1e-9, 0.1]])  # the first two are less than float32 can tell from 1
    end = move_within(start, offset)
    assert end[0, 0] == start[0, 0]
    assert end[0, 1] == start[0, 1]
    assert 0.0999999 < end[0, 2] <= 0.1


BOX = Boxes(np.array([[5.0, 5.0, 0.0, 4.0, 2.0, 40.0, 0.3]]), np.zeros(1, np.int64), ("a",), np.zeros((1, 3)))


def away_m(points):
    """How far points lie outside BOX, by the largest of the three ways."""
    c, s = np.cos(0.3), np.sin(0.3)
    x, y, z = (points - [5.0, 5.0, 0.0]).T
    return np.max(np.abs([x * c + y * s, y * c - x * s, z]) - np.array([[2.0], [1.0], [20.0]]), axis=0)


def test_remove_near_objects_first():
    cloud = cloud_of(4000, 20.0)
    near = np.flatnonzero(away_m(xyz(cloud)) <= 0.5)
    assert 10 < len(near) < 100
    for count in (5, len(near), len(near) + 7):
        kept = remove_random_points(cloud, count, np.random.default_rng(0), BOX)
        removed = np.setdiff1d(np.arange(4000), kept)
        assert len(removed) == count
        assert len(np.intersect1d(removed, near)) == min(count, len(near))


def test_offsets_are_uniform_over_the_ball():
    offset = random_offsets(5000, 2.0, np.random.default_rng(0))
    length = np.linalg.norm(offset, axis=1)
    assert (length <= 2.0).all()
    assert kstest((length / 2.0) ** 3, "uniform").pvalue > 0.01  # the share of the volume inside
    assert kstest(offset[:, 2] / length, "uniform", args=(-1, 2)).pvalue > 0.01


def test_add_puts_the_points_near_the_objects():
    cloud = cloud_of(4000, 20.0)
    added = add_random_points(cloud, 200, 0.5, np.random.default_rng(0), BOX)
    assert added[:4000].tobytes() == cloud.tobytes()
    assert len(added) == 4200
    distance = np.linalg.norm(xyz(added[4000:])[:, None] - xyz(cloud)[None], axis=2).min(axis=1)
    assert (distance <= 0.5 + 1e-6).all()
    assert (np.linalg.norm(xyz(added[4000:])[:, :2] - [5.0, 5.0], axis=1) < np.hypot(2, 1) + 1.3).all()


def test_add_without_boxes_or_with_empty_ones_uses_the_whole_cloud():
    cloud = cloud_of(100)
    for boxes in (None, Boxes()):
        added = add_random_points(cloud, 50, 0.5, np.random.default_rng(0), boxes)
        assert len(added) == 150
        assert np.ptp(added["x"][100:]) > 30
    assert len(add_random_points(cloud[:0], 5, 0.5, np.random.default_rng(0))) == 0
