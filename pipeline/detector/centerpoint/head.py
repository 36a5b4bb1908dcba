"""The centre head: a heat map of each class, and a box at every cell (OpenPCDet's CenterHead)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import cast

import torch
from torch import Tensor, nn

from advpipe.pipeline.detector.centerpoint.presets import CenterPointPreset
from advpipe.pipeline.detector.common.backbone2d import Convolve, padded

PRIOR = 0.1
"""Score of every cell before training (Zhou et al., "Objects as Points", section 4)."""


@dataclass(frozen=True)
class CentrePredictions:
    """Raw output for B clouds and N cells in (H, W) order.

    scores: (B, N, classes) logits of the heat. codes: (B, N, C), see `targets.CentreGrid.encode`.
    qualities: (B, N) logits of the box's IoU with the truth; None where the preset has none.
    """

    scores: Tensor
    codes: Tensor
    qualities: Tensor | None = None


def _layer(c_in: int, channels: int) -> nn.Sequential:
    norm = nn.BatchNorm2d(channels, eps=1e-5, momentum=0.05)
    return nn.Sequential(nn.Conv2d(c_in, channels, 3, padding=1), norm, nn.ReLU(inplace=True))


class CentreHead(nn.Module):
    """A shared 3 x 3 layer, and for each type of prediction a branch of two more."""

    reach = 3

    def __init__(self, preset: CenterPointPreset, c_in: int) -> None:
        super().__init__()
        channels = preset.head_channels
        self.shared = _layer(c_in, channels)
        self.code = preset.code
        widths = {**self.code, "hm": len(preset.classes)}  # by OpenPCDet's names: the heat map
        if preset.quality_power is not None:
            widths["iou"] = 1
        self.hidden = nn.ModuleDict({name: _layer(channels, channels) for name in widths})
        self.last = nn.ModuleDict({name: nn.Conv2d(channels, n, 3, padding=1) for name, n in widths.items()})
        for name, last in self.last.items():
            # With small weights the biases dominate at first: large outputs would dominate the first steps.
            nn.init.normal_(cast("Tensor", last.weight), std=0.01)
            bias = -log((1 - PRIOR) / PRIOR) if name == "hm" else 0.0
            nn.init.constant_(cast("Tensor", last.bias), bias)

    def forward(self, features: Tensor, convolve: Convolve = padded) -> CentrePredictions:
        """Predictions for features (B, C, H, W), the last layer in full precision; `convolve` as in
        `Backbone2d.forward`."""
        shared = _applied(self.shared, features, convolve)
        parts = {}
        for name, hidden in self.hidden.items():
            inner = _applied(cast("nn.Sequential", hidden), shared, convolve)
            last = cast("nn.Conv2d", self.last[name])
            with torch.autocast(features.device.type, enabled=False):
                map_ = convolve(last, inner.to(last.weight.dtype))
            parts[name] = map_.permute(0, 2, 3, 1).flatten(1, 2)
        codes = torch.cat([parts[name] for name in self.code], dim=2)
        return CentrePredictions(parts["hm"], codes, parts["iou"].squeeze(2) if "iou" in parts else None)


def _applied(layers: nn.Sequential, x: Tensor, convolve: Convolve) -> Tensor:
    convolution, norm, relu = layers
    out: Tensor = relu(norm(convolve(cast("nn.Conv2d", convolution), x)))
    return out
