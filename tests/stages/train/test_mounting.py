"""Other mounts and other ground, worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.stages.train.config import Augmentation
from advpipe.stages.train.frames import TrainingFrame
from advpipe.stages.train.mounting import remount, slope, tilt


def frame(*places: tuple[float, float, float]) -> TrainingFrame:
    """Points at these places, and a car about each."""
    points = np.array([(*place, 0.5) for place in places], np.float32)
    boxes = np.array([(*place, 4.2, 1.8, 1.5, 0.3) for place in places])
    labels = np.zeros(len(places), np.int64)
    return TrainingFrame(points, boxes, labels, labels)


def test_ground_rises_beyond_the_crease_alone() -> None:
    risen = slope(frame((5, 0, -1), (30, 7, -1), (-30, 0, -1)), np.arctan(0.1), 0.0, 10.0)
    assert risen.points[:, 2] == pytest.approx([-1, 1, -1], abs=1e-6)
    assert risen.boxes[:, 2] == pytest.approx([-1, 1, -1])
    assert risen.boxes[:, :2].tolist() == [[5, 0], [30, 7], [-30, 0]]


def test_tilt_about_the_axis_to_the_left_lowers_what_is_ahead() -> None:
    # A right-handed turn about y takes x to -z.
    tilted = tilt(frame((10, 0, 0), (0, 10, 0)), np.deg2rad(3), np.pi / 2)
    expected = [[10 * np.cos(np.deg2rad(3)), 0, -10 * np.sin(np.deg2rad(3))], [0, 10, 0]]
    assert tilted.points[:, :3] == pytest.approx(np.array(expected), abs=1e-5)
    assert tilted.boxes[:, :3] == pytest.approx(np.array(expected), abs=1e-9)
    assert (tilted.boxes[:, 6] == 0.3).all()


def test_points_and_boxes_are_raised_together_and_within_the_bounds() -> None:
    config = replace(Augmentation(), remounted=1.0, tilt_rad=0.0, slope_rad=0.0)
    before = frame((10, 0, -1))
    raised_m = []
    for seed in range(50):
        after = remount(before, config, np.random.default_rng(seed))
        assert after.points[0, 2] == pytest.approx(after.boxes[0, 2], abs=1e-6)
        raised_m.append(after.boxes[0, 2] + 1)
    assert max(map(abs, raised_m)) <= config.height_m
    assert min(raised_m) < -0.3 < 0.3 < max(raised_m)


def test_a_share_of_the_frames_stays_as_it_is() -> None:
    before = frame((10, 0, -1))
    config = replace(Augmentation(), remounted=0.25)
    kept = [remount(before, config, np.random.default_rng(seed)) is before for seed in range(400)]
    assert np.mean(kept) == pytest.approx(0.75, abs=0.07)
