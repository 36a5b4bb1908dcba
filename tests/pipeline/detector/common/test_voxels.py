"""Voxelisation: which voxel, which mean, which gradient."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from advpipe.pipeline.detector.common.voxels import voxelise
from advpipe.pipeline.detector.second.presets import KITTI, SMALL

POINTS = torch.tensor(
    [
        [-51.2, -51.2, -4.35, 0.5],  # the lowest corner: inside
        [0.01, 0.02, 0.0, 1.0],
        [0.09, 0.04, 0.1, 0.0],  # the same voxel as the point before
        [51.2, 0.0, 0.0, 0.5],  # on the upper bound: outside
        [0.0, 0.0, 3.04, 0.5],  # above
        [float("nan"), 0.0, 0.0, 0.5],
        [0.0, 0.0, 0.0, float("inf")],
    ]
)


def test_voxels_have_mean_features_and_rows_of_points():
    voxels = voxelise([POINTS], SMALL)
    assert voxels.point_to_voxel.tolist() == [0, 1, 1, -1, -1, -1, -1]
    torch.testing.assert_close(
        voxels.features, torch.tensor([[-51.2, -51.2, -4.35, 0.5], [0.05, 0.03, 0.05, 0.5]])
    )
    batch, z, y, x = voxels.sites.bzyx()
    assert batch.tolist() == [0, 0]
    assert z.tolist() == [0, 24]
    assert y.tolist() == [0, 512]
    assert x.tolist() == [0, 512]


def test_gradient_reaches_every_read_point_equally():
    points = POINTS.clone().requires_grad_()
    voxelise([points], SMALL).features[:, 0].sum().backward()
    assert points.grad[:, 0].tolist() == [1, 0.5, 0.5, 0, 0, 0, 0]
    assert not points.grad[:, 1:].any()


def test_clouds_of_a_batch_stay_separate():
    both = voxelise([POINTS, POINTS[1:2]], SMALL)
    assert both.sites.bzyx()[0].tolist() == [0, 0, 1]
    torch.testing.assert_close(both.features[:2], voxelise([POINTS], SMALL).features)
    torch.testing.assert_close(both.features[2], POINTS[1])


def test_the_order_of_points_does_not_matter():
    order = torch.tensor([6, 2, 4, 0, 1, 3, 5])
    a, b = voxelise([POINTS], SMALL), voxelise([POINTS[order]], SMALL)
    torch.testing.assert_close(a.features, b.features)
    assert torch.equal(a.point_to_voxel[order], b.point_to_voxel)


def test_clouds_without_points_in_range_have_no_voxels():
    for cloud in (torch.zeros(0, 4), torch.full((3, 4), 1e9), torch.full((2, 4), float("nan"))):
        voxels = voxelise([cloud], SMALL)
        assert voxels.features.shape == (0, 4)
        assert voxels.point_to_voxel.tolist() == [-1] * len(cloud)


# Nine points in three voxels of `kitti`; their intensities count them.
ORDER = "ABAACABAA"
CELLS = {"A": (1.01, 1.01, 0.01), "B": (2.01, 0.01, 0.01), "C": (3.01, 0.01, 0.01)}


def kitti_points():
    return torch.tensor([[*CELLS[name], float(number)] for number, name in enumerate(ORDER)])


def test_only_the_first_five_points_of_a_voxel_are_used():
    points = kitti_points().requires_grad_()
    voxels = voxelise([points], KITTI)
    # By y, then x: B, C, A. The sixth point of A, number 8, has no say in its mean and no gradient.
    torch.testing.assert_close(voxels.features[:, 3], torch.tensor([3.5, 4.0, (0 + 2 + 3 + 5 + 7) / 5]))
    voxels.features[:, 3].sum().backward()
    assert points.grad[:, 3].tolist() == pytest.approx([0.2, 0.5, 0.2, 0.2, 1.0, 0.2, 0.5, 0.2, 0.0])
    # It still lies in the voxel: who empties the voxel has to remove it too.
    assert voxels.point_to_voxel.tolist() == [2, 0, 2, 2, 1, 2, 0, 2, 2]


def test_only_the_first_voxels_of_each_cloud_are_used():
    preset = replace(KITTI, max_voxels=2, max_voxels_training=1)
    points = kitti_points()
    voxels = voxelise([points, points[4:]], preset)
    # First cloud: A and B came first; second: C and A.
    assert voxels.point_to_voxel.tolist() == [1, 0, 1, 1, -1, 1, 0, 1, 1] + [2, 3, -1, 3, 3]
    assert voxels.sites.bzyx()[0].tolist() == [0, 0, 1, 1]
    torch.testing.assert_close(voxels.features[:, 3], torch.tensor([3.5, 3.4, 4.0, 20 / 3]))
    training = voxelise([points], preset, training=True)
    assert training.point_to_voxel.tolist() == [0, -1, 0, 0, -1, 0, -1, 0, 0]
    assert len(voxelise([points], KITTI, training=True).sites) == 3


def test_the_layer_above_the_range_of_kitti_stays_empty():
    points = torch.tensor([[1.0, 0.0, 0.95, 0.0], [1.0, 0.0, 1.0, 0.0], [1.0, 0.0, 1.05, 0.0]])
    voxels = voxelise([points], KITTI)
    assert voxels.point_to_voxel.tolist() == [0, -1, -1]
    assert voxels.sites.bzyx()[1].tolist() == [39]
