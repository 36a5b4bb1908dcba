"""Points to voxels: which points each holds, and their mean, differentiable to the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from advpipe.pipeline.detector.common.preset import VoxelPreset
from advpipe.pipeline.detector.common.sparse_conv import Sites


@dataclass(frozen=True)
class OccupiedVoxels:
    """The V occupied voxels of a batch of clouds.

    sites: where they are.
    point_to_voxel: (N,) int64 row of each point of the concatenated clouds, -1 for ignored points.
    holds_points: (V,) bool; the other voxels hold only probe points.
    """

    sites: Sites
    point_to_voxel: Tensor
    holds_points: Tensor


@dataclass(frozen=True)
class VoxelPoints(OccupiedVoxels):
    """The U points that voxels use: points (U, 4), and voxel (U,) the row of each."""

    points: Tensor
    voxel: Tensor


@dataclass(frozen=True)
class Voxels(OccupiedVoxels):
    """features: (V, 4) mean x, y, z, intensity of the used points inside."""

    features: Tensor


def voxelise(
    clouds: Sequence[Tensor], preset: VoxelPreset, *, training: bool = False, probes: Sequence[int] = ()
) -> Voxels:
    """The voxels of clouds (N_i, 4), as in `points_by_voxel`, with the means of their points."""
    held = points_by_voxel(clouds, preset, training=training, probes=probes)
    return Voxels(held.sites, held.point_to_voxel, held.holds_points, mean_by_voxel(held.points, held))


def mean_by_voxel(values: Tensor, held: VoxelPoints) -> Tensor:
    """The mean (V, C) of the values (U, C) of each voxel's points."""
    voxels = len(held.sites)
    count = torch.bincount(held.voxel, minlength=voxels).to(values.dtype)
    total = values.new_zeros(voxels, values.shape[1]).index_add(0, held.voxel, values)
    return total / count[:, None]


def points_by_voxel(
    clouds: Sequence[Tensor], preset: VoxelPreset, *, training: bool = False, probes: Sequence[int] = ()
) -> VoxelPoints:
    """The voxels of clouds (N_i, 4) x, y, z, intensity, one batch entry each, and the points in them.

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
    return VoxelPoints(Sites(keys, shape, len(clouds)), point_to_voxel, holds_points, inside, voxel)


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
