from __future__ import annotations

from dataclasses import replace

import pytest
import torch

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
    for module in net.modules():
        if isinstance(module, (torch.nn.BatchNorm1d, torch.nn.BatchNorm2d)):
            torch.nn.init.uniform_(module.weight, 0.7, 1.3)
            torch.nn.init.uniform_(module.bias, -0.3, 0.5)
            torch.nn.init.uniform_(module.running_mean, -0.2, 0.2)
            torch.nn.init.uniform_(module.running_var, 0.3, 1.0)
    torch.nn.init.normal_(net.head.convolution.weight, std=0.1)
    return Second(net)
