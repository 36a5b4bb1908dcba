"""The anchor head: scores, box codes, driving direction and, if the preset sets it, the quality of
the box at every anchor (OpenPCDet's AnchorHeadSingle; the quality: Wu et al. 2020)."""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from advpipe.pipeline.detector.common.backbone2d import Convolve, padded
from advpipe.pipeline.detector.common.preset import AnchorPreset

PRIOR = 0.01
"""Score of every anchor before training (Lin et al., "Focal Loss", section 4.1)."""


@dataclass(frozen=True)
class Predictions:
    """Raw output for B clouds and N anchors in (H, W, A) order.

    scores: (B, N, classes) logits. codes: (B, N, 7). directions: (B, N, 2) logits.
    qualities: (B, N) logits of the box's IoU with the truth; None where the preset has none.
    """

    scores: Tensor
    codes: Tensor
    directions: Tensor
    qualities: Tensor | None = None

    def of_cloud(self, b: int) -> Predictions:
        """Those of cloud `b` alone, as a batch of one."""
        qualities = None if self.qualities is None else self.qualities[b : b + 1]
        one = slice(b, b + 1)
        return Predictions(self.scores[one], self.codes[one], self.directions[one], qualities)


class Head(nn.Module):
    """A 1 x 1 convolution for each type of prediction."""

    reach = 0

    def __init__(self, preset: AnchorPreset, c_in: int) -> None:
        super().__init__()
        self.anchors = len(preset.anchors) * len(preset.yaws_rad)
        values = [len(preset.classes), 7, 2] + [1] * (preset.quality_power is not None)
        self.widths = [self.anchors * n for n in values]
        # One convolution for all: its output is split.
        self.convolution = nn.Conv2d(c_in, sum(self.widths), 1)
        scores, codes, *_ = self.convolution.bias.data.split(self.widths)  # type: ignore[union-attr]
        scores.fill_(-log((1 - PRIOR) / PRIOR))
        codes.zero_()
        # With small weights the prior dominates at first: large logits would dominate the first steps.
        first, second, *_ = torch.split(self.convolution.weight.data, self.widths)
        nn.init.normal_(first, std=0.01)
        nn.init.normal_(second, std=0.001)

    def forward(self, features: Tensor, convolve: Convolve = padded) -> Predictions:
        """Predictions for features (B, C, H, W), in full precision; no cell reads another one, so that
        `convolve` is not needed."""
        # As a matrix product: on one CPU thread PyTorch's own 1 x 1 convolution is many times slower.
        weight, bias = self.convolution.weight.flatten(1), self.convolution.bias
        with torch.autocast(features.device.type, enabled=False):
            out = F.linear(features.to(weight.dtype).permute(0, 2, 3, 1), weight, bias)
        batch, height, width, _ = out.shape
        anchors = height * width * self.anchors
        scores, codes, directions, *quality = (
            part.reshape(batch, anchors, -1) for part in torch.split(out, self.widths, 3)
        )
        return Predictions(scores, codes, directions, quality[0].squeeze(2) if quality else None)
