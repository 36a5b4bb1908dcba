"""Points to voxels: the mean voxel feature encoder, differentiable to the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from advpipe.pipeline.detector.second.presets import SecondPreset
from advpipe.pipeline.detector.second.sparse_conv import Sites


@dataclass(frozen=True)
class Voxels:
    """The V occupied voxels of a batch of clouds.

    features: (V, 4) mean x, y, z, intensity of the used points inside.
    sites: where they are.
    point_to_voxel: (N,) int64 row of each point of the concatenated clouds, -1 for ignored points.
    holds_points: (V,) bool; the other voxels hold only probe points.
    """

    features: Tensor
    sites: Sites
    point_to_voxel: Tensor
    holds_points: Tensor


def voxelise(
    clouds: Sequence[Tensor], preset: SecondPreset, *, training: bool = False, probes: Sequence[int] = ()
) -> Voxels:
    """The voxels of clouds (N_i, 4) x, y, z, intensity, one batch entry each.

    Points that are out of range or not finite are ignored. All points of a voxel are used, so the order of
    the points does not matter and each has a gradient. Where the preset limits the points of a voxel or the
    voxels of a cloud (with another number in `training`), the first ones are used, as in OpenPCDet.

    probes: how many of each cloud's last points are probe points. They have no effect in a voxel that also
    holds a point; a voxel without a point gets its features from them.
    """
    points = torch.cat(list(clouds))
    batch = torch.cat([torch.full((len(c),), b, device=c.device) for b, c in enumerate(clouds)])
    r, size = preset.range_m, points.new_tensor(preset.voxel_size_m)
    depth, height, width = shape = preset.grid_zyx
    low = points.new_tensor([r.x_min_m, r.y_min_m, r.z_min_m])
    upper = torch.tensor([width, height, depth - preset.layers_above], device=points.device)
    cells = torch.floor((points.detach()[:, :3] - low) / size)
    read = ((cells >= 0) & (cells < upper)).all(1) & torch.isfinite(points.detach()).all(1)
    rows = read.nonzero().squeeze(1)
    x, y, z = cells[rows].long().unbind(1)
    keys, voxel = torch.unique(Sites.key(batch[rows], z, y, x, shape), return_inverse=True)
    max_voxels = preset.max_voxels_training if training else preset.max_voxels
    if max_voxels is not None and len(keys) > max_voxels:
        kept = _first_voxels(batch[rows], voxel, len(keys), max_voxels)
        rows, voxel = rows[kept[voxel]], (kept.cumsum(0) - 1)[voxel[kept[voxel]]]
        keys = keys[kept]
    point_to_voxel = torch.full((len(points),), -1, dtype=torch.int64, device=points.device)
    point_to_voxel[rows] = voxel
    holds_points = torch.ones(len(keys), dtype=torch.bool, device=points.device)
    if any(probes):
        is_probe = _last_of_each(clouds, probes)[rows]
        holds_points = torch.zeros_like(holds_points).index_fill(0, voxel[~is_probe], True)
        counts = ~is_probe | ~holds_points[voxel]
        rows, voxel = rows[counts], voxel[counts]
    if preset.points_per_voxel is not None:
        counts = _place_in_voxel(voxel) < preset.points_per_voxel
        rows, voxel = rows[counts], voxel[counts]
    inside = points if len(rows) == len(points) else points.index_select(0, rows)
    count = torch.bincount(voxel, minlength=len(keys)).to(points.dtype)
    total = points.new_zeros(len(keys), points.shape[1]).index_add(0, voxel, inside)
    return Voxels(total / count[:, None], Sites(keys, shape, len(clouds)), point_to_voxel, holds_points)


def _last_of_each(clouds: Sequence[Tensor], counts: Sequence[int]) -> Tensor:
    """Which points (N,) of the concatenated clouds are among the last `counts` points of their cloud."""
    return torch.cat(
        [
            torch.arange(len(cloud), device=cloud.device) >= len(cloud) - count
            for cloud, count in zip(clouds, counts, strict=True)
        ]
    )


def _place_in_voxel(voxel: Tensor) -> Tensor:
    """How many earlier points (N,) lie in the same voxel (N,)."""
    order = torch.sort(voxel, stable=True).indices
    ends = torch.bincount(voxel).cumsum(0)
    starts = torch.cat([ends.new_zeros(1), ends])[voxel[order]]
    places = torch.arange(len(voxel), device=voxel.device) - starts
    return torch.empty_like(voxel).index_copy(0, order, places)


def _first_voxels(batch: Tensor, voxel: Tensor, count: int, limit: int) -> Tensor:
    """Which of `count` voxels are among the first `limit` of their cloud, in the order of the points (N,)."""
    places = torch.arange(len(voxel), device=voxel.device)
    first = places.new_full((count,), len(voxel)).scatter_reduce(0, voxel, places, "amin")
    # The points of a cloud follow one another, and so do its voxels in the order of their first points.
    by_age = torch.sort(first).indices
    kept = torch.empty(count, dtype=torch.bool, device=voxel.device)
    kept[by_age] = _place_in_voxel(batch[first[by_age]]) < limit
    return kept
