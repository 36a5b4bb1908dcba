"""The bird's-eye backbone: blocks of 2D convolutions at two scales, upsampled and concatenated (OpenPCDet's
BaseBEVBackbone)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import torch
from torch import Tensor, nn

from advpipe.pipeline.detector.common.preset import BevBlock

Convolve = Callable[[nn.Conv2d, Tensor], Tensor]


def padded(layer: nn.Conv2d, x: Tensor) -> Tensor:
    """The layer as it is: zeros beyond the map."""
    out: Tensor = layer(x)
    return out


def _norm_relu(channels: int) -> list[nn.Module]:
    return [nn.BatchNorm2d(channels, eps=1e-3, momentum=0.05), nn.ReLU(inplace=True)]


class Upsample(nn.ConvTranspose2d):
    """A transposed convolution whose kernel is its stride, as a matrix product: faster on a CPU."""

    def forward(self, input: Tensor, output_size: list[int] | None = None) -> Tensor:
        batch, channels, height, width = input.shape
        k, out = self.kernel_size[0], self.out_channels
        weight = self.weight.permute(0, 2, 3, 1).reshape(channels, k * k * out)
        cells = (input.permute(0, 2, 3, 1) @ weight).view(batch, height, width, k, k, out)
        # (B, H, W, k, k, C) to (B, C, H k, W k), channels last in memory.
        fine = cells.permute(0, 1, 3, 2, 4, 5).reshape(batch, height * k, width * k, out)
        return fine.permute(0, 3, 1, 2)


class Backbone2d(nn.Module):
    """Blocks that each halve the map or keep its size; their outputs are upsampled to one scale and
    concatenated.

    stride: cells of the input along a cell of the output; coarsest: along a cell of the last block.
    """

    def __init__(self, sizes: Sequence[BevBlock], c_in: int) -> None:
        super().__init__()
        self.blocks, self.ups = nn.ModuleList(), nn.ModuleList()
        scale = 1
        for size in sizes:
            channels, stride = size.channels, size.up_stride
            block: list[nn.Module] = [nn.Conv2d(c_in, channels, 3, size.stride, padding=1, bias=False)]
            block += _norm_relu(channels)
            for _ in range(size.layers):
                block += [nn.Conv2d(channels, channels, 3, padding=1, bias=False), *_norm_relu(channels)]
            self.blocks.append(nn.Sequential(*block))
            scale, c_in = scale * size.stride, channels
            if size.up_channels:
                up = Upsample(channels, size.up_channels, stride, stride, bias=False)
                self.ups.append(nn.Sequential(up, *_norm_relu(size.up_channels)))
                self.stride = scale // stride
            else:
                self.ups.append(nn.Identity())
        self.out_channels = sum(size.up_channels for size in sizes)
        self.coarsest = scale

    def forward(self, bev: Tensor, convolve: Convolve = padded) -> Tensor:
        """Features (B, sum of the blocks' up_channels, H, W) of a map (B, C, H, W).

        convolve: applies a 3 x 3 convolution; another one for maps that are pieces of a larger one.
        """
        ups = []
        for block, up in zip(self.blocks, self.ups, strict=True):
            for layer in cast("nn.Sequential", block):
                bev = convolve(layer, bev) if isinstance(layer, nn.Conv2d) else layer(bev)
            if isinstance(up, nn.Sequential):
                ups.append(up(bev))
        return torch.cat(ups, dim=1)
