"""Points by voxel, against a grouping point by point."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from advpipe.pipeline.detector.common.padded_voxels import padded_voxels

RANGE_M, SIZE_M = (0.0, -10.0, -3.0, 20.0, 10.0, 1.0), (0.5, 0.4, 2.0)
SHAPE = (40, 50, 2)


@pytest.fixture
def points():
    """Many of them out of range, on its faces, or not finite."""
    draw = np.random.default_rng(1)
    xyz = np.concatenate([draw.uniform((-2, -12, -4), (22, 12, 2), (400, 3)), draw.normal(5, 0.3, (60, 3))])
    xyz[:4] = [(0, -10, -3), (20, 0, 0), (5, 10, 0), (5, 5, 1)]
    xyz[60:460, 2] = draw.uniform(-3, 1, 400)
    xyz[10:14] = [(np.nan, 0, 0), (3, np.inf, 0), (3, 0, -np.inf), (np.nan, np.nan, np.nan)]
    return torch.tensor(np.column_stack([xyz, draw.uniform(0, 1, len(xyz))]), dtype=torch.float32)


@pytest.mark.parametrize("most", [1, 3, 100])
def test_points_are_grouped_by_their_voxels(points, most):
    voxels, counts, cells = padded_voxels(points, RANGE_M, SIZE_M, most)
    expected: dict[tuple[int, ...], list[list[float]]] = {}
    for point in points[points.isfinite().all(1)].tolist():
        cell = tuple(
            int(np.floor((np.float32(value) - np.float32(low)) / np.float32(size)))
            for value, low, size in zip(point, RANGE_M[:3], SIZE_M, strict=False)
        )
        if all(0 <= n < count for n, count in zip(cell, SHAPE, strict=True)):
            expected.setdefault((0, *cell[::-1]), []).append(point)
    assert max(map(len, expected.values())) > 3
    assert {tuple(cell) for cell in cells.tolist()} == set(expected)
    assert cells.dtype == torch.int32
    for voxel, count, cell in zip(voxels.tolist(), counts.tolist(), cells.tolist(), strict=True):
        mine = expected[tuple(cell)][:most]
        assert count == len(mine)
        assert voxel == mine + [[0.0] * 4] * (most - count)


def test_the_gradient_reaches_the_points_that_are_kept(points):
    leaf = points.clone().requires_grad_()
    voxels, counts, _ = padded_voxels(leaf, RANGE_M, SIZE_M, 2)
    (gradient,) = torch.autograd.grad(voxels.sum(), leaf)
    assert gradient.sum() == 4 * counts.sum()
    assert set(gradient.unique().tolist()) == {0.0, 1.0}


def test_no_point_in_range_is_no_voxel():
    voxels, counts, cells = padded_voxels(torch.full((3, 4), 99.0), RANGE_M, SIZE_M, 5)
    assert (voxels.shape, counts.shape, cells.shape) == ((0, 5, 4), (0,), (0, 4))
