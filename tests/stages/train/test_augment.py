"""Augmentation leaves every label true: the same points stay in the same boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.stages.train.augment import ObjectBank, augment, flip, rotate
from advpipe.stages.train.config import Augmentation
from advpipe.stages.train.frames import FrameStore, cropped

VOXEL = (0.1, 0.1, 0.15)


@pytest.fixture
def store(drive, tmp_path):
    return FrameStore.build(
        (cropped(frame, 30.0) for frame in read_frames(drive)), tmp_path / "frames", "key"
    )


def inside(frame):
    """Points in each box, grown by 1 mm so that rounding moves none out."""
    return count_points(frame.points, frame.boxes + [0, 0, 0, 1e-3, 1e-3, 1e-3, 0])


def test_rotation_by_hand(store):
    frame = store.frame(0)
    turned = rotate(frame, np.pi / 2)
    np.testing.assert_allclose(turned.points[:, 0], -frame.points[:, 1], atol=1e-5)
    np.testing.assert_allclose(turned.points[:, 1], frame.points[:, 0], atol=1e-5)
    np.testing.assert_array_equal(turned.points[:, 2:], frame.points[:, 2:])
    np.testing.assert_array_equal(inside(turned), inside(frame))


def test_flip_by_hand(store):
    frame = store.frame(0)
    np.testing.assert_array_equal(flip(frame).points[:, 1], -frame.points[:, 1])
    np.testing.assert_array_equal(inside(flip(frame)), inside(frame))


@pytest.mark.parametrize("seed", range(5))
def test_rigid_changes_keep_the_points_in_their_boxes(store, seed):
    config = replace(Augmentation(), drop=0.0, jitter_m=0.0, paste=(0, 0, 0, 0), remounted=0.0)
    frame = store.frame(seed)
    changed = augment(frame, config, VOXEL, np.random.default_rng(seed))
    assert not np.allclose(changed.points, frame.points)
    np.testing.assert_allclose(inside(changed), inside(frame), atol=1)  # of points on a face
    ratio = changed.boxes[:, 3:6] / frame.boxes[:, 3:6]
    assert np.ptp(ratio) < 1e-9
    assert 0.95 <= ratio.flat[0] <= 1.05


def test_no_augmentation_changes_nothing(store):
    frame = store.frame(2)
    same = augment(frame, Augmentation.none(), VOXEL, np.random.default_rng(0), ObjectBank(store, 5))
    np.testing.assert_array_equal(same.points, frame.points)
    np.testing.assert_allclose(same.boxes, frame.boxes, rtol=1e-12)


def test_a_pillar_as_high_as_the_range_hardly_shifts_heights(store):
    frame, config = store.frame(0), replace(Augmentation.none(), shift_voxels=0.5)
    shifts = [
        augment(frame, config, (0.16, 0.16, 7.38), np.random.default_rng(seed)).boxes[0, :3]
        - frame.boxes[0, :3]
        for seed in range(20)
    ]
    largest_m = np.abs(shifts).max(axis=0)
    assert (largest_m <= [0.08, 0.08, 0.25]).all()
    assert (largest_m > [0.04, 0.04, 0.12]).all()


def test_counts_follow_dropped_points(store):
    frame = store.frame(0)
    dropped = augment(frame, replace(Augmentation.none(), drop=0.9), VOXEL, np.random.default_rng(1))
    share = len(dropped.points) / len(frame.points)
    assert 0.1 <= share < 0.95
    np.testing.assert_allclose(dropped.counts, frame.counts * share, rtol=0.15)


def test_pasted_objects_stand_free_with_all_their_points(store):
    bank = ObjectBank(store, 5)
    assert [len(rows) for rows in bank.by_class[0]] == [6, 6, 6, 6]
    frame = store.frame(0)
    pasted = bank.paste(frame, (3, 3, 3, 3), np.random.default_rng(3))
    added = slice(len(frame.boxes), None)
    assert len(pasted.boxes) > len(frame.boxes)
    assert len(pasted.boxes) == len(pasted.labels) == len(pasted.counts)
    overlap = iou_bev(pasted.boxes, pasted.boxes)
    assert overlap[~np.eye(len(overlap), dtype=bool)].max() == 0
    # The scene's own points made room, and every pasted point arrived.
    found = inside(pasted)
    np.testing.assert_allclose(found[added], pasted.counts[added], atol=3)
    np.testing.assert_array_equal(pasted.boxes[: len(frame.boxes)], frame.boxes)
    # Each is an object of some frame, at the same distance.
    distances = np.hypot(*store._index["boxes"][:, :2].T)
    for distance in np.hypot(*pasted.boxes[added, :2].T):
        assert np.abs(distances - distance).min() < 1e-6


def test_the_same_generator_gives_the_same_frame(store):
    bank = ObjectBank(store, 5)
    a, b = (augment(store.frame(1), Augmentation(), VOXEL, np.random.default_rng(9), bank) for _ in range(2))
    assert a.points.tobytes() == b.points.tobytes()
    assert a.boxes.tobytes() == b.boxes.tobytes()
