from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from batch_norms import draw_batch_norms

from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import SMALL

TINY = replace(SMALL, name="tiny", range_m=Range(-6.4, -6.4, -3.1, 6.4, 6.4, 2.3))
"""`small` over an eighth of the width: the same layers, a sixty-fourth of the map."""


@pytest.fixture
def tiny() -> Second:
    """A network of random weights whose batch norms have seen something."""
    torch.manual_seed(5)
    net = SecondNet(TINY)
    draw_batch_norms(net)
    torch.nn.init.normal_(net.head.convolution.weight, std=0.1)
    return Second(net)
