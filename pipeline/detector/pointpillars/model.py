"""PointPillars (Lang et al.: "PointPillars: Fast Encoders for Object Detection from Point Clouds", CVPR
2019)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from advpipe.pipeline.detector.common.anchor_network import AnchorNetwork
from advpipe.pipeline.detector.common.backbone2d import Backbone2d
from advpipe.pipeline.detector.common.head import Head
from advpipe.pipeline.detector.common.voxel_detector import VoxelNetworkDetector
from advpipe.pipeline.detector.common.voxels import VoxelPoints, points_by_voxel
from advpipe.pipeline.detector.pointpillars.encoder import PillarEncoder
from advpipe.pipeline.detector.pointpillars.presets import PointPillarsPreset


class PointPillarsNet(AnchorNetwork[VoxelPoints]):
    """Pillars, one vector each, scattered to the bird's-eye map; 2D backbone, anchor head."""

    preset: PointPillarsPreset

    def __init__(self, preset: PointPillarsPreset) -> None:
        super().__init__()
        self.preset = preset
        self.encoder = PillarEncoder(preset)
        self.backbone2d = Backbone2d(preset.bev, preset.channels)
        self.head = Head(preset, self.backbone2d.out_channels)

    @property
    def voxels_per_cell(self) -> int:
        return self.backbone2d.stride

    def voxels(self, clouds: Sequence[Tensor], probes: Sequence[int] = ()) -> VoxelPoints:
        return points_by_voxel(clouds, self.preset, probes=probes)

    def bird_eye(self, voxels: VoxelPoints, occupancy: Tensor | None) -> Tensor:
        """A pillar's vector is not negative, so times an occupancy of 0 it is a cell without a pillar."""
        pillars: Tensor = self.encoder(voxels)
        if occupancy is not None:
            pillars = pillars * occupancy[:, None]
        maps, height, width = self._map_shape(voxels)
        dense = pillars.new_zeros(maps * height * width, pillars.shape[1])
        dense.index_copy_(0, self._cells(voxels), pillars)  # in place: no second copy of the map
        return dense.view(maps, height, width, -1).permute(0, 3, 1, 2)

    def occupied_cells(self, voxels: VoxelPoints) -> Tensor:
        maps, height, width = self._map_shape(voxels)
        cells = torch.zeros(maps * height * width, dtype=torch.bool, device=voxels.voxel.device)
        return cells.index_fill(0, self._cells(voxels), True).view(maps, height, width)

    def detector(self, provenance: Mapping[str, str]) -> VoxelNetworkDetector[PointPillarsNet]:
        return VoxelNetworkDetector(self, provenance)

    def _map_shape(self, voxels: VoxelPoints) -> tuple[int, int, int]:
        _, height, width = voxels.sites.shape
        return voxels.sites.batch_size, height, width

    def _cells(self, voxels: VoxelPoints) -> Tensor:
        """The flat cells (V,) of the map in which pillars stand."""
        _, height, width = voxels.sites.shape
        batch, _, y, x = voxels.sites.bzyx()
        return (batch * height + y) * width + x
