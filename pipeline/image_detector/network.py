"""The network: a small residual backbone, a pyramid merged at a fourth of the image's size, one head there.

Every cell of the head has a score for each class and the distances from its centre to the four edges of a
box, as in TTFNet (Liu et al., AAAI 2020): no anchors, and any size of image.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, pad
from torch.nn.utils.fusion import fuse_conv_bn_eval

from advpipe.pipeline.geometry.boxes import CLASSES

STRIDE = 4
"""Pixels from one cell of the head to the next."""

COARSEST = 32
"""Images are padded on the right and below to a multiple of it."""

SPAN_PX = 16.0
"""Distances are learned in units of it."""

PRIOR = 0.01
"""Every cell's score before training."""

MEAN, DEVIATION = 0.4, 0.25
"""Of the values of pixels, roughly."""


@dataclass(frozen=True)
class ImagePreset:
    """A size of the network. widths: channels at strides 4, 8, 16 and 32. neck: channels of the pyramid."""

    name: str
    classes: tuple[str, ...] = CLASSES
    widths: tuple[int, int, int, int] = (32, 64, 96, 128)
    neck: int = 64
    head: int = 32


PRESETS = {"small": ImagePreset("small")}


@dataclass(frozen=True)
class Cells:
    """What the head says of B images: score logits (B, C, h, w), and boxes_px (B, 4, h, w), left, top, right,
    bottom as in `ImageDetections`."""

    logits: Tensor
    boxes_px: Tensor


class ImageNet(nn.Module):
    """B images (B, 3, H, W) float32 RGB in 0 to 1 to `Cells`."""

    def __init__(self, preset: ImagePreset) -> None:
        super().__init__()
        self.preset = preset
        w4, w8, w16, w32 = preset.widths
        self.stem = nn.Sequential(_conv(3, w4 // 2, 2), _conv(w4 // 2, w4, 2))
        self.stages = nn.ModuleList(
            [
                _Residual(w4),
                nn.Sequential(_conv(w4, w8, 2), _Residual(w8), _Residual(w8)),
                nn.Sequential(_conv(w8, w16, 2), _Residual(w16)),
                nn.Sequential(_conv(w16, w32, 2), _Residual(w32)),
            ]
        )
        necks = (preset.head, preset.neck, preset.neck, preset.neck)
        self.lateral = nn.ModuleList(
            nn.Conv2d(width, neck, 1) for width, neck in zip(preset.widths, necks, strict=True)
        )
        self.narrow = nn.Conv2d(preset.neck, preset.head, 1)
        self.merge = nn.ModuleList(_conv(width, width) for width in necks[:3])
        self.score = _branch(preset.head, len(preset.classes))
        self.edges = _branch(preset.head, 4)
        nn.init.constant_(self.score[-1].bias, math.log(PRIOR / (1 - PRIOR)))  # type: ignore[arg-type]

    def forward(self, images: Tensor) -> Cells:
        height, width = images.shape[-2:]
        right, below = -width % COARSEST, -height % COARSEST
        features = self.stem((pad(images, (0, right, 0, below), "replicate") - MEAN) / DEVIATION)
        levels = []
        for stage in self.stages:
            features = stage(features)
            levels.append(features)
        merged = self.lateral[3](levels[3])
        for level in (2, 1, 0):
            if level == 0:
                merged = self.narrow(merged)
            wider = interpolate(merged, scale_factor=2.0)
            merged = self.merge[level](self.lateral[level](levels[level]) + wider)
        rows, columns = -(-height // STRIDE), -(-width // STRIDE)  # cells of the padding see nothing
        logits, edges = self.score(merged)[..., :rows, :columns], self.edges(merged)[..., :rows, :columns]
        return Cells(_whole(logits), cell_boxes_px(_whole(edges), height, width))


def cell_centres_px(rows: int, columns: int) -> tuple[Tensor, Tensor]:
    """The places of the cells' centres: columns (w,) and rows (h,) in pixels."""
    offset = (STRIDE - 1) / 2
    return torch.arange(columns) * STRIDE + offset, torch.arange(rows) * STRIDE + offset


def cell_boxes_px(edges: Tensor, height: int, width: int) -> Tensor:
    """The boxes (B, 4, h, w) in an image of this size, from what the head says of their edges (B, 4, h, w).

    The distance from a cell's centre to an edge is softplus(edge) * SPAN_PX.
    """
    x, y = (each.to(edges.device) for each in cell_centres_px(*edges.shape[-2:]))
    away = nn.functional.softplus(edges) * SPAN_PX
    left, top, right, bottom = away.unbind(1)
    x, y = x[None, None, :], y[None, :, None]
    boxes = ((x - left), (y - top), (x + right), (y + bottom))
    limits = (width - 1.0, height - 1.0, width - 1.0, height - 1.0)
    return torch.stack([box.clamp(0.0, limit) for box, limit in zip(boxes, limits, strict=True)], dim=1)


class _Residual(nn.Module):
    """Two convolutions and their input (He et al. 2016)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = _conv(width, width)
        self.second = nn.Sequential(nn.Conv2d(width, width, 3, padding=1, bias=False), nn.BatchNorm2d(width))

    def forward(self, features: Tensor) -> Tensor:
        changed: Tensor = torch.relu(features + self.second(self.first(features)))
        return changed


def _conv(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, padding=1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
    )


def _whole(values: Tensor) -> Tensor:
    """In single precision at least: what half precision says of boxes is too coarse."""
    return values.float() if values.dtype == torch.bfloat16 else values


def _branch(width: int, outputs: int) -> nn.Sequential:
    last = nn.Conv2d(width, outputs, 1)
    nn.init.normal_(last.weight, std=0.01)
    return nn.Sequential(_conv(width, width), last)


def with_folded_norms(net: ImageNet) -> ImageNet:
    """A copy that computes the same without its batch norms, which are frozen: a third faster."""
    folded = copy.deepcopy(net).eval()
    for module in list(folded.modules()):
        if isinstance(module, nn.Sequential) and len(module) >= 2 and isinstance(module[1], nn.BatchNorm2d):
            assert isinstance(module[0], nn.Conv2d)
            module[0] = fuse_conv_bn_eval(module[0], module[1])
            module[1] = nn.Identity()
    return folded
