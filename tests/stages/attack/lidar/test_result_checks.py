"""What a user's attack may return, one mistake at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.points import PointLabels
from advpipe.stages.attack.lidar.base import LidarResult
from advpipe.stages.attack.lidar.result_checks import refuse_invalid


@pytest.fixture
def clean(make_cloud):
    return make_cloud(np.arange(30.0).reshape(10, 3))


def labels(points=(2, 3), actions=("removed", "removed"), displacement_m=None):
    away_m = np.full(len(points), np.nan) if displacement_m is None else displacement_m
    return PointLabels(np.array(points, np.int64), np.array(actions, np.str_), away_m)


def test_right_ones_pass(clean):
    refuse_invalid("mine:Mine", clean, LidarResult(np.delete(clean, [2, 3]), labels()))
    refuse_invalid("mine:Mine", clean, LidarResult(clean, labels((4,), ("moved",), np.array([0.1]))))
    added = LidarResult(np.concatenate([clean, clean[:1]]), labels((-1,), ("added",), np.array([0.1])))
    refuse_invalid("mine:Mine", clean, replace(added, loss_before=1, loss_after=np.float32(2)))
    refuse_invalid("mine:Mine", clean, LidarResult(clean, labels((), ())))


def test_changes_that_no_label_states(clean):
    moved, turned = clean.copy(), clean[::-1].copy()
    moved["z"][4] += 0.1
    moved["z"][5] = clean["z"][5] = np.nan  # is what it was
    refuse_invalid("mine:Mine", clean, LidarResult(moved, labels((4,), ("moved",), np.array([0.1]))))
    line = "changed points without labels"
    refused(clean, LidarResult(moved, labels((), ())), line)
    refused(clean, LidarResult(moved, labels((3,), ("moved",), np.array([0.1]))), line)
    refused(clean, LidarResult(turned, labels((), ())), line)
    refused(clean, LidarResult(np.delete(clean, [2, 4]), labels()), line)
    first = LidarResult(np.concatenate([clean[:1], clean]), labels((-1,), ("added",), np.array([0.0])))
    refused(clean, first, line)


WRONG_LABELS = [
    (None, "returned NoneType as its labels, not PointLabels"),
    ([2, 3], "returned list as its labels, not PointLabels"),
    (PointLabels(np.array([2.0, 3.0]), np.array(["moved"] * 2), np.zeros(2)),
     r"returned an array \(2,\) of float64 as labels.point"),
    (PointLabels([2, 3], np.array(["moved"] * 2), np.zeros(2)), "returned list as labels.point"),
    (PointLabels(np.array([2, 3]), np.array(["moved"] * 2), None), "returned NoneType as labels.displ"),
    (PointLabels(np.array([[2, 3]]), np.array(["moved"] * 2), np.zeros(2)), r"an array \(1, 2\) of int64 as"),
    (labels((2,)), "labels of several lengths: {'point': 1, 'action': 2, 'displacement_m': 1}"),
    (labels((2, 3), ("moved", "melted")), "labels points as 'melted'; known: removed, moved, added"),
    (labels((2, 10), ("moved", "moved")), "labels points that the cloud of 10 does not have"),
    (labels((-1, 2), ("moved", "moved")), "labels points that the cloud of 10 does not have"),
    (labels((7,), ("added",)), "and -1 for added ones"),
    (labels(), "made 10 points 10, but labels 2 as removed and 0 as added"),
]  # fmt: skip


@pytest.mark.parametrize(("wrong", "line"), WRONG_LABELS)
def test_wrong_labels(clean, wrong, line):
    refused(clean, LidarResult(clean, wrong), line)


def test_wrong_clouds_and_figures(clean):
    nothing, points = labels((), ()), np.zeros((10, 4), np.float32)
    refused(clean, (clean, nothing), "returned tuple, not a LidarResult")
    refused(clean, None, "returned NoneType, not a LidarResult")
    refused(clean, LidarResult(None, nothing), "returned NoneType as its cloud, not points")
    refused(clean, LidarResult(points, nothing), r"returned an array \(10, 4\) of float32 as its cloud")
    refused(clean, LidarResult(clean[:, None], nothing), r"returned an array \(10, 1\) of .* as its cloud")
    refused(
        clean, LidarResult(clean, nothing, loss_after=None), "returned None as its loss_after, not a number"
    )
    refused(clean, LidarResult(clean, nothing, note=None), "returned None as its note, not text")


def refused(clean, result, line):
    with pytest.raises(AdvpipeError, match=f"^mine:Mine .*{line}") as caught:
        refuse_invalid("mine:Mine", clean, result)
    assert "\n" not in str(caught.value)
