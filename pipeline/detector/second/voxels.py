"""Points to voxels: the mean voxel feature encoder, differentiable to the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from advpipe.pipeline.detector.second.presets import Preset
from advpipe.pipeline.detector.second.sparse_conv import Sites


@dataclass(frozen=True)
class Voxels:
    """The V occupied voxels of a batch of clouds.

    features: (V, 4) mean x, y, z, intensity of the points inside.
    sites: where they are.
    point_to_voxel: (N,) int64 row of each point of the concatenated clouds, -1 if not read.
    """

    features: Tensor
    sites: Sites
    point_to_voxel: Tensor


def voxelise(clouds: Sequence[Tensor], preset: Preset) -> Voxels:
    """The voxels of clouds (N_i, 4) x, y, z, intensity, one batch entry each.

    Points out of range or not finite are not read. Every point of a voxel counts: unlike OpenPCDet
    there is no limit of five, so the order of the points does not matter and each has a gradient.
    """
    points = torch.cat(list(clouds))
    batch = torch.cat([torch.full((len(c),), b, device=c.device) for b, c in enumerate(clouds)])
    r, size = preset.range_m, points.new_tensor(preset.voxel_size_m)
    depth, height, width = preset.grid_zyx
    low = points.new_tensor([r.x_min_m, r.y_min_m, r.z_min_m])
    upper = torch.tensor([width, height, depth], device=points.device)
    cells = torch.floor((points.detach()[:, :3] - low) / size)
    read = ((cells >= 0) & (cells < upper)).all(1) & torch.isfinite(points.detach()).all(1)
    rows = read.nonzero().squeeze(1)
    x, y, z = cells[rows].long().unbind(1)
    shape = (depth, height, width)
    keys, inverse = torch.unique(Sites.key(batch[rows], z, y, x, shape), return_inverse=True)
    inside = points if len(rows) == len(points) else points.index_select(0, rows)
    count = torch.bincount(inverse, minlength=len(keys)).to(points.dtype)
    total = points.new_zeros(len(keys), points.shape[1]).index_add(0, inverse, inside)
    point_to_voxel = torch.full((len(points),), -1, dtype=torch.int64, device=points.device)
    point_to_voxel[rows] = inverse
    return Voxels(total / count[:, None], Sites(keys, shape, len(clouds)), point_to_voxel)
