"""The sparse 3D backbone: voxels to a dense bird's-eye map (OpenPCDet's VoxelBackBone8x)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from advpipe.pipeline.detector.common.preset import SparsePreset
from advpipe.pipeline.detector.common.sparse_conv import (
    Rulebook,
    Shape,
    Sites,
    SparseLayer,
    reached,
    strided_rules,
    submanifold_rules,
)

# Kernel, stride and padding along z, y, x of the four strided layers.
STRIDED: tuple[tuple[Shape, Shape, Shape], ...] = (
    ((3, 3, 3), (2, 2, 2), (1, 1, 1)),
    ((3, 3, 3), (2, 2, 2), (1, 1, 1)),
    ((3, 3, 3), (2, 2, 2), (0, 1, 1)),
    ((3, 1, 1), (2, 1, 1), (0, 0, 0)),
)


class Backbone3d(nn.Module):
    """Four stages of submanifold layers, all but the first begin with stride two; a last layer compresses
    z."""

    def __init__(self, preset: SparsePreset) -> None:
        super().__init__()
        c0, c1, c2, c3, c4, c5 = preset.channels_3d
        self.stage1 = nn.ModuleList([SparseLayer(preset.input_features, c0), SparseLayer(c0, c1)])
        self.stage2 = nn.ModuleList([SparseLayer(c1, c2), SparseLayer(c2, c2), SparseLayer(c2, c2)])
        self.stage3 = nn.ModuleList([SparseLayer(c2, c3), SparseLayer(c3, c3), SparseLayer(c3, c3)])
        self.stage4 = nn.ModuleList([SparseLayer(c3, c4), SparseLayer(c4, c4), SparseLayer(c4, c4)])
        self.fold = SparseLayer(c4, c5, kernel=STRIDED[-1][0])
        depth = preset.grid_zyx[0]
        for kernel, stride, padding in STRIDED:
            depth = (depth + 2 * padding[0] - kernel[0]) // stride[0] + 1
        self.out_channels = c5 * depth

    def forward(self, features: Tensor, sites: Sites, occupancy: Tensor | None = None) -> Tensor:
        """The bird's-eye map (B, C, H, W), channels last in memory, of voxel features (V, C).

        occupancy: (V,) in [0, 1]; a voxel of occupancy 0 acts as if it held no point.
        """
        if occupancy is not None:
            features = features * occupancy[:, None]
        same = submanifold_rules(sites)
        for layer in self.stage1:
            features = layer(features, same, occupancy)
        for stage, geometry in zip((self.stage2, self.stage3, self.stage4), STRIDED, strict=False):
            down = strided_rules(same.sites, *geometry)
            occupancy = None if occupancy is None else reached(occupancy, down)
            features = stage[0](features, down, occupancy)
            same = submanifold_rules(down.sites)
            for layer in list(stage)[1:]:
                features = layer(features, same, occupancy)
        fold = strided_rules(same.sites, *STRIDED[-1])
        occupancy = None if occupancy is None else reached(occupancy, fold)
        return to_bev(self.fold(features, fold, occupancy), fold)


def to_bev(features: Tensor, rules: Rulebook) -> Tensor:
    """Sparse features (V, C) as a dense map (B, D * C, H, W), channels last in memory."""
    depth, height, width = rules.sites.shape
    batch, z, y, x = rules.sites.bzyx()
    cells = ((batch * height + y) * width + x) * depth + z
    channels = features.shape[1]
    dense = features.new_zeros(rules.sites.batch_size * height * width * depth, channels)
    dense.index_copy_(0, cells, features)  # in place: no second copy of the map
    bev: Tensor = dense.view(rules.sites.batch_size, height, width, depth * channels).permute(0, 3, 1, 2)
    return bev


def cells_below(sites: Sites) -> Tensor:
    """The cells (B, H, W) bool of the bird's-eye map that these voxels reach through the layers."""
    height, width = (n // 8 for n in sites.shape[1:])
    batch, _, y, x = sites.bzyx()
    # A voxel reaches the cell that it lies in and, except the first of a cell, the next one.
    rows = y // 8, ((y + 7) // 8).clamp(max=height - 1)
    columns = x // 8, ((x + 7) // 8).clamp(max=width - 1)
    reached_cells = torch.cat([(batch * height + row) * width + column for row in rows for column in columns])
    cells = torch.zeros(sites.batch_size * height * width, dtype=torch.bool, device=sites.keys.device)
    return cells.index_fill(0, reached_cells, True).view(sites.batch_size, height, width)
