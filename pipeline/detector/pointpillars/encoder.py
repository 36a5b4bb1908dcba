"""The pillar feature net: the points of each pillar to one vector (OpenPCDet's PillarVFE)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from advpipe.pipeline.detector.common.voxels import VoxelPoints, mean_by_voxel
from advpipe.pipeline.detector.pointpillars.presets import PointPillarsPreset

POINT_FEATURES = 10
"""Of a point: x, y, z, intensity; its offset from the mean of its pillar, and from the pillar's centre."""


class PillarEncoder(nn.Module):
    """A linear layer on each point, batch norm, ReLU, and the maximum over the points of a pillar.

    A preset that limits the points of a pillar has rows of zeros behind fewer points, as OpenPCDet does, and
    they take part in the maximum: what the batch norm makes of zero is the least that a pillar can have.
    """

    input_offset: Tensor
    scale: Tensor

    def __init__(self, preset: PointPillarsPreset) -> None:
        super().__init__()
        self.preset = preset
        self.linear = nn.Linear(POINT_FEATURES, preset.channels, bias=False)
        self.norm = nn.BatchNorm1d(preset.channels, eps=1e-3, momentum=0.05)
        scale = (*preset.input_scale, *preset.from_mean_scale, *preset.from_centre_scale)
        self.register_buffer("input_offset", torch.tensor(preset.input_offset), persistent=False)
        self.register_buffer("scale", torch.tensor(scale), persistent=False)

    def forward(self, held: VoxelPoints) -> Tensor:
        """The features (V, channels), not negative, of the pillars; differentiable to the points."""
        limit = self.preset.points_per_voxel
        points = self.norm(self.linear(self.point_features(held)))
        rows = held.voxel[:, None].expand_as(points)
        pillars = points.new_zeros(len(held.sites), points.shape[1])
        pillars = pillars.scatter_reduce(0, rows, points, "amax", include_self=False)
        if limit is not None:
            has_padding = torch.bincount(held.voxel, minlength=len(pillars)) < limit
            zero = self._of_zeros()
            pillars = torch.where(has_padding[:, None], torch.maximum(pillars, zero), pillars)
        return torch.relu(pillars)

    def point_features(self, held: VoxelPoints) -> Tensor:
        """The features (U, 10) of the points in pillars."""
        r, size = self.preset.range_m, self.preset.voxel_size_m
        _, z, y, x = held.sites.bzyx()
        low = held.points.new_tensor([r.x_min_m, r.y_min_m, r.z_min_m])
        cells = torch.stack([x, y, z], dim=1)
        centres = (cells.to(low.dtype) + 0.5) * held.points.new_tensor(size) + low
        xyz = held.points[:, :3]
        means = mean_by_voxel(xyz, held)
        parts = [held.points - self.input_offset, xyz - means[held.voxel], xyz - centres[held.voxel]]
        return torch.cat(parts, dim=1) * self.scale

    def _of_zeros(self) -> Tensor:
        """What the batch norm makes of a row of zeros (1, channels), by its running averages."""
        norm = self.norm
        mean, variance = norm.get_buffer("running_mean"), norm.get_buffer("running_var")
        return (norm.bias - mean / torch.sqrt(variance + norm.eps) * norm.weight)[None]
