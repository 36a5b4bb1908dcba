"""The matrix products that stand for convolutions, against PyTorch's convolutions."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from advpipe.pipeline.detector.common.backbone2d import Backbone2d, Upsample
from advpipe.pipeline.detector.common.head import Head
from advpipe.pipeline.detector.second.presets import SMALL


@pytest.mark.oracle
@pytest.mark.parametrize("stride", [1, 2, 4])
def test_upsample_equals_a_transposed_convolution(stride):
    torch.manual_seed(0)
    layer = Upsample(6, 5, stride, stride, bias=False)
    x = torch.randn(2, 6, 7, 3).to(memory_format=torch.channels_last)
    torch.testing.assert_close(layer(x), nn.ConvTranspose2d.forward(layer, x))


@pytest.mark.oracle
def test_the_head_equals_a_convolution():
    torch.manual_seed(0)
    head = Head(SMALL, 12)
    x = torch.randn(2, 12, 4, 5)
    out = head(x)
    expected = head.convolution(x).permute(0, 2, 3, 1)
    scores, codes, directions, qualities = expected.split([48, 84, 24, 12], dim=3)
    torch.testing.assert_close(out.scores, scores.reshape(2, 240, 4))
    torch.testing.assert_close(out.codes, codes.reshape(2, 240, 7))
    torch.testing.assert_close(out.directions, directions.reshape(2, 240, 2))
    torch.testing.assert_close(out.qualities, qualities.reshape(2, 240))


def test_the_map_keeps_its_size():
    net = Backbone2d(SMALL.bev, 64).eval()
    assert net(torch.zeros(1, 64, 16, 24)).shape == (1, 256, 16, 24)
    assert net.out_channels == 256
