"""Networks on mean voxels and the sparse 3D backbone, as SECOND has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import torch
from torch import Tensor
from torch.nn import functional as F

from advpipe.pipeline.detector.common.backbone2d import Backbone2d
from advpipe.pipeline.detector.common.backbone3d import Backbone3d, cells_below
from advpipe.pipeline.detector.common.preset import SparsePreset
from advpipe.pipeline.detector.common.voxel_network import HeadOutput, VoxelNetwork
from advpipe.pipeline.detector.common.voxels import Voxels, voxelise

P = TypeVar("P", bound=HeadOutput)


class SparseNetwork(VoxelNetwork[Voxels, P]):
    """Each family adds a head on the 2D backbone."""

    preset: SparsePreset
    input_offset: Tensor
    input_scale: Tensor

    def __init__(self, preset: SparsePreset) -> None:
        super().__init__()
        self.preset = preset
        self.backbone3d = Backbone3d(preset)
        self.backbone2d = Backbone2d(preset.bev, self.backbone3d.out_channels)
        self.register_buffer("input_offset", torch.tensor(preset.input_offset), persistent=False)
        self.register_buffer("input_scale", torch.tensor(preset.input_scale), persistent=False)

    @property
    def voxels_per_cell(self) -> int:
        """The backbone's own cells have eight."""
        return 8 * self.backbone2d.stride

    def voxels(self, clouds: Sequence[Tensor], probes: Sequence[int] = ()) -> Voxels:
        return voxelise(clouds, self.preset, probes=probes)

    def inputs(self, voxels: Voxels) -> Tensor:
        """The features (V, C) that the sparse backbone reads."""
        features = (voxels.features - self.input_offset) * self.input_scale
        if self.preset.place_in_voxel:
            features = torch.cat([features, self._place_in_voxel(voxels)], dim=1)
        return F.pad(features, (0, self.preset.extra_features))

    def _place_in_voxel(self, voxels: Voxels) -> Tensor:
        """Where in its voxel each mean lies (V, 3), from -1/2 to 1/2 along x, y and z."""
        r, means = self.preset.range_m, voxels.features[:, :3]
        _, z, y, x = voxels.sites.bzyx()
        low_m = means.new_tensor([r.x_min_m, r.y_min_m, r.z_min_m])
        place = (means - low_m) / means.new_tensor(self.preset.voxel_size_m)
        return place - torch.stack([x, y, z], dim=1).to(place.dtype) - 0.5

    def bird_eye(self, voxels: Voxels, occupancy: Tensor | None) -> Tensor:
        bev: Tensor = self.backbone3d(self.inputs(voxels), voxels.sites, occupancy)
        return bev

    def occupied_cells(self, voxels: Voxels) -> Tensor:
        return cells_below(voxels.sites)
