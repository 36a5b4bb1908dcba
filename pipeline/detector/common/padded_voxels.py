"""Points by voxel, as OpenPCDet and MMDetection3D pass them to a network, but with a gradient."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import pad


def padded_voxels(
    points: Tensor, range_m: Sequence[float], voxel_size_m: Sequence[float], points_per_voxel: int
) -> tuple[Tensor, Tensor, Tensor]:
    """The points (N, C) in range by voxel: the first `points_per_voxel` of each (V, points_per_voxel, C),
    padded with zeros; their number (V,), int64; and the voxels (V, 4), int32: 0, then the cell along z, y, x.

    range_m: lowest x, y, z, then highest. voxel_size_m: along x, y, z. Both toolboxes do this outside of the
    gradient; here it reaches the points through the values in their voxel, not through the choice of the
    voxel. Points that are not finite are out of range.
    """
    low_m, high_m, size_m = (points.new_tensor(each) for each in (range_m[:3], range_m[3:], voxel_size_m))
    places = (points[:, :3].detach() - low_m) / size_m
    inside = ((places >= 0) & (places < ((high_m - low_m) / size_m).round())).all(1)
    cells, voxel, count = torch.unique(
        places[inside].floor().int().flip(1), dim=0, return_inverse=True, return_counts=True
    )
    order = torch.argsort(voxel, stable=True)
    slot = torch.arange(len(order), device=points.device) - (count.cumsum(0) - count)[voxel[order]]
    order, slot = order[slot < points_per_voxel], slot[slot < points_per_voxel]
    voxels = points.new_zeros(len(cells), points_per_voxel, points.shape[1])
    voxels = voxels.index_put((voxel[order], slot), points[inside][order])
    return voxels, count.clamp(max=points_per_voxel), pad(cells, (1, 0))
