"""The features of pillars, against those of padded tensors and values worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import nn

from advpipe.pipeline.detector.common.voxels import points_by_voxel
from advpipe.pipeline.detector.pointpillars.encoder import PillarEncoder
from advpipe.pipeline.detector.pointpillars.presets import KITTI, SMALL


def test_features_of_points_equal_values_computed_by_hand():
    # Two points in the pillar at x .16 to .32, y -39.68 to -39.52, whose centre is (.24, -39.6, -1).
    points = torch.tensor([[0.2, -39.6, -1.5, 0.5], [0.3, -39.55, -0.5, 0.1]])
    features = PillarEncoder(KITTI).point_features(points_by_voxel([points], KITTI))
    expected = [
        [0.2, -39.6, -1.5, 0.5, -0.05, -0.025, -0.5, -0.04, 0.0, -0.5],
        [0.3, -39.55, -0.5, 0.1, 0.05, 0.025, 0.5, 0.06, 0.05, 0.5],
    ]
    torch.testing.assert_close(features, torch.tensor(expected), atol=1e-5, rtol=1e-5)


def test_small_sees_heights_larger_than_offsets_within_a_pillar():
    """From the ground to the roof of a car z goes from below -1 to above 1; offsets stay small beside it."""
    torch.manual_seed(0)
    points = (torch.rand(20_000, 4) - 0.5) * torch.tensor([102.0, 102.0, 1.6, 1.0])
    points += torch.tensor([0.0, 0.0, -1.0, 0.5])
    features = PillarEncoder(SMALL).point_features(points_by_voxel([points], SMALL)).abs().amax(0)
    place, height, intensity, *offsets = (float(features[column]) for column in (0, 2, 3, 4, 5, 7, 8))
    assert 0.9 < min(place, intensity) <= max(place, intensity) <= 1
    assert 1.5 < height < 2
    assert max(offsets) < 0.25


@pytest.mark.oracle
@pytest.mark.parametrize("training", [False, True])
def test_pillars_equal_the_maximum_over_a_padded_tensor(training):
    """With PyTorch's layers on (V, P, 10), zeros behind the last point; without a limit, of the points
    alone."""
    torch.manual_seed(1)
    preset = SMALL if training else replace(KITTI, points_per_voxel=4)
    encoder = PillarEncoder(preset).train(training)
    nn.init.uniform_(encoder.norm.bias, -0.5, 0.5)
    nn.init.uniform_(encoder.norm.running_mean, -0.5, 0.5)
    points = torch.rand(300, 4) * torch.tensor([1.0, 1.0, 2.0, 1.0]) + torch.tensor([3.0, 0.0, -1.0, 0.0])
    held = points_by_voxel([points], preset)
    found = encoder(held)
    features = encoder.point_features(held)
    groups = [features[held.voxel == row] for row in range(len(held.sites))]
    assert {len(group) for group in groups} > {4} if not training else True
    if training:
        normed = nn.functional.batch_norm(
            encoder.linear(features), None, None, encoder.norm.weight, encoder.norm.bias, True, 0.0, 1e-3
        )
        expected = torch.stack([normed[held.voxel == row].relu().amax(0) for row in range(len(groups))])
    else:
        padded = torch.stack([nn.functional.pad(group, (0, 0, 0, 4 - len(group))) for group in groups])
        hidden = encoder.norm(encoder.linear(padded).permute(0, 2, 1)).permute(0, 2, 1)
        expected = hidden.relu().amax(1)
        assert (hidden[:, -1] > hidden[:, 0]).any()  # where padding is the maximum
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-5)
