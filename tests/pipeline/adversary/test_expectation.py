"""Views of points under draws of defences, and what is computed in them brought back."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch

from advpipe.pipeline.adversary.expectation import Expectation
from advpipe.pipeline.adversary.targets import AttackTargets
from advpipe.pipeline.defences.base import Placement
from advpipe.pipeline.defences.placing import Flip
from advpipe.pipeline.defences.thinning import OutlierRemoval
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import cloud_of_xyzi, xyz

BOX = np.array([[4.0, 2.0, 1.0, 4.5, 1.8, 1.5, 0.7]])


@pytest.fixture
def points():
    """Two hundred points within a metre, and one far from all."""
    drawn = np.random.default_rng(1).uniform(0, 1, (200, 4)).astype(np.float32)
    return np.concatenate([drawn, [[30, 30, 30, 0.5]]]).astype(np.float32)


def test_the_first_view_shows_the_points_as_they_are(points):
    first, *others = Expectation.of_defences(points).views(points, np.random.default_rng(2))
    assert first.points.tobytes() == points.tobytes()
    assert first.source.tolist() == list(range(201))
    assert len(others) == 3
    for view in others:
        assert view.points.tobytes() != points.tobytes()


def test_views_are_drawn_anew(points):
    expectation, rng = Expectation.of_defences(points), np.random.default_rng(2)
    _, _, one, _ = expectation.views(points, rng)
    _, _, two, _ = expectation.views(points, rng)
    assert one.points.tobytes() != two.points.tobytes()


def test_each_point_of_a_view_has_its_source(points):
    """Up to noise and rounding, it is its source, placed as the view is."""
    for view in Expectation.of_defences(points).views(points, np.random.default_rng(3)):
        placed = view.probes(points)[view.source]
        assert np.abs(placed[:, :3] - view.points[:, :3]).max() < 0.1
        assert (placed[:, 3] == view.points[:, 3]).all()
    assert 200 not in view.source  # the last one removes what lies alone


def test_targets_and_detections_follow_the_placement(points):
    targets = AttackTargets(torch.from_numpy(BOX.astype(np.float32)), torch.zeros(1).long())
    views = Expectation.of_defences(points).views(points, np.random.default_rng(4))
    for view in views + Expectation.of_views(points).views(points, np.random.default_rng(4)):
        there = view.targets(targets).boxes.double().numpy()
        back = view.found_back(Detections(there, np.ones(1), np.zeros(1, np.int64)))
        assert back.boxes == pytest.approx(BOX, abs=1e-5)
        assert view.probes(np.append(BOX[:, :3], [[0]], 1).astype(np.float32))[0, :3] == pytest.approx(
            there[0, :3], abs=1e-5
        )


def test_one_placement_after_another():
    shift, flip = Placement(offset_m=np.array([1.0, 2.0, 3.0])), Placement(scale=2.0, is_mirrored=True)
    turn = Placement(scale=0.5, is_mirrored=True, offset_m=np.array([-1.0, 0.5, 0.0]), yaw_rad=0.6)
    cloud = cloud_of_xyzi(np.array([[1, 1, 1, 0]], np.float32))
    for first, second in itertools.permutations((shift, flip, turn, Placement(yaw_rad=-1.1)), 2):
        both, one = first.followed_by(second), second.cloud(first.cloud(cloud))
        assert xyz(both.cloud(cloud)) == pytest.approx(xyz(one), abs=1e-6)
        assert both.boxes_there(BOX) == pytest.approx(second.boxes_there(first.boxes_there(BOX)))
        assert both.boxes_back(both.boxes_there(BOX)) == pytest.approx(BOX)


def test_a_flip_mirrors_the_heading():
    mirrored = Flip()(cloud_of_xyzi(np.zeros((0, 4), np.float32)), np.random.default_rng(0)).placement
    assert mirrored.boxes_there(BOX)[0] == pytest.approx([4.0, -2.0, 1.0, 4.5, 1.8, 1.5, -0.7])


def test_a_part_is_thinned_as_in_the_whole(points):
    """Of the dense points alone, statistical outlier removal would remove some that the whole cloud keeps."""
    whole, part = cloud_of_xyzi(points), cloud_of_xyzi(points[:200])
    rng = np.random.default_rng(0)
    assert len(OutlierRemoval()(whole, rng).cloud) == 200
    assert len(OutlierRemoval()(part, rng).cloud) < 200
    assert len(OutlierRemoval().limited_by(whole)(part, rng).cloud) == 200


def test_a_turn_is_about_the_vertical_axis():
    """By 90° to the left: what lies ahead lies to the left, and looks there."""
    turned = Placement(yaw_rad=np.pi / 2).boxes_there(np.array([[4.0, 1.0, 2.0, 4.5, 1.8, 1.5, 0.0]]))
    assert turned[0] == pytest.approx([-1.0, 4.0, 2.0, 4.5, 1.8, 1.5, np.pi / 2])


def test_other_views_keep_all_points_and_are_drawn_within_bounds(points):
    rng, placements = np.random.default_rng(5), []
    for _ in range(20):
        first, *others = Expectation.of_views(points).views(points, rng)
        assert first.points.tobytes() == points.tobytes()
        assert [view.placement.is_mirrored for view in others] == [True, False, True]
        for view in others:
            assert view.source.tolist() == list(range(len(points)))
            assert np.array_equal(view.points, view.probes(points))
            placements.append(view.placement)
    for values, low, high in (
        ([each.scale for each in placements], 0.95, 1.05),
        ([each.yaw_rad for each in placements], -np.pi / 8, np.pi / 8),
        (np.concatenate([each.offset_m for each in placements]), -0.08, 0.08),
    ):
        assert low <= min(values) < low + 0.2 * (high - low)
        assert high - 0.2 * (high - low) < max(values) <= high
