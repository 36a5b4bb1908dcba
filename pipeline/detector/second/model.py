"""SECOND (Yan, Mao, Li: "SECOND: Sparsely Embedded Convolutional Detection", Sensors 2018)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from advpipe.pipeline.detector.common.anchors import AnchorGrid
from advpipe.pipeline.detector.common.backbone2d import Backbone2d
from advpipe.pipeline.detector.common.decode import decode_detections
from advpipe.pipeline.detector.common.head import Head, Predictions
from advpipe.pipeline.detector.common.loss import LOSS_PARTS, losses, losses_by_cloud
from advpipe.pipeline.detector.common.network import (
    DetectionNetwork,
    LabelledPoints,
    NetworkDetector,
    require_finite,
)
from advpipe.pipeline.detector.common.tiles import OccupiedMap
from advpipe.pipeline.detector.protocol import Detections, LossInput, OccupancyLoss, VoxelGrid
from advpipe.pipeline.detector.second.backbone3d import Backbone3d, cells_below
from advpipe.pipeline.detector.second.presets import SecondPreset
from advpipe.pipeline.detector.second.voxels import Voxels, voxelise


class SecondNet(DetectionNetwork):
    """Voxels, sparse 3D backbone, bird's-eye backbone, anchor head."""

    LOSS_PARTS = LOSS_PARTS
    preset: SecondPreset
    input_offset: Tensor
    input_scale: Tensor

    def __init__(self, preset: SecondPreset) -> None:
        super().__init__()
        self.preset = preset
        self._grid: AnchorGrid | None = None
        self.backbone3d = Backbone3d(preset)
        self.backbone2d = Backbone2d(preset.bev, self.backbone3d.out_channels)
        self.head = Head(preset, self.backbone2d.out_channels)
        self._occupied_map = OccupiedMap(self.backbone2d, self.head)
        self.register_buffer("input_offset", torch.tensor(preset.input_offset), persistent=False)
        self.register_buffer("input_scale", torch.tensor(preset.input_scale), persistent=False)

    def forward(self, voxels: Voxels, occupancy: Tensor | None = None, bf16: bool = False) -> Predictions:
        """Predictions for the voxels of a batch of clouds; `occupancy` (V,) as in `Backbone3d`."""
        bev = self._bird_eye(voxels, occupancy)
        with torch.autocast(bev.device.type, torch.bfloat16, enabled=bf16):
            features = self.backbone2d(bev)
        predictions: Predictions = self.head(features.to(bev.dtype))
        return predictions

    def near_voxels(self, voxels: Voxels, occupancy: Tensor) -> Predictions:
        """As `forward`, with frozen weights; an empty map's predictions far from all voxels, see `tiles`."""
        return self._occupied_map(self._bird_eye(voxels, occupancy), cells_below(voxels.sites))

    def _bird_eye(self, voxels: Voxels, occupancy: Tensor | None) -> Tensor:
        features = (voxels.features - self.input_offset) * self.input_scale
        bev: Tensor = self.backbone3d(features, voxels.sites, occupancy)
        return bev

    def training_losses(self, cloud: LabelledPoints, *, bf16: bool = False) -> tuple[Tensor, ...]:
        """The gradient reaches the points through their voxel's mean; the assignment of points to voxels has
        no gradient. Without a point in range the loss is that of an empty map, and its gradient is zero."""
        target = self.anchor_grid().assign(cloud.boxes, cloud.labels, cloud.ignored, cloud.uncounted)
        predictions = self(voxelise([cloud.points], self.preset), bf16=bf16)
        return losses(predictions, [target], self.anchor_grid()).parts

    def detections(self, clouds: Sequence[Tensor]) -> list[Detections]:
        """At most `preset.max_detections` in each; points that are not finite are ignored."""
        voxels = voxelise(clouds, self.preset)
        return self.decoded(self(voxels), voxels)

    def decoded(self, predictions: Predictions, voxels: Voxels) -> list[Detections]:
        """The objects in each cloud of a batch; none in a cloud without a point in range."""
        count = voxels.sites.batch_size
        held = torch.bincount(voxels.sites.bzyx()[0][voxels.holds_points], minlength=count).cpu().tolist()
        none = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
        grid = self.anchor_grid()
        return [decode_detections(predictions, b, grid) if held[b] else none for b in range(count)]

    def detector(self, provenance: Mapping[str, str]) -> Second:
        return Second(self, provenance)

    def anchor_grid(self) -> AnchorGrid:
        """The anchors on the backbones' output map: one eighth of the voxel grid."""
        if self._grid is None or self._grid.x.device != self.device:
            _, height, width = self.preset.grid_zyx
            self._grid = AnchorGrid(self.preset, height // 8, width // 8, self.device)
        return self._grid


class Second(NetworkDetector[SecondNet]):
    """A trained SECOND as a `BatchDetector`."""

    @property
    def preset(self) -> SecondPreset:
        """The preset of the network."""
        return self.net.preset

    @property
    def voxel_grid(self) -> VoxelGrid:
        """The voxels that the network reads, without the layers that only pad its height."""
        depth, height, width = self.preset.grid_zyx
        r = self.preset.range_m
        shape = (width, height, depth - self.preset.layers_above)
        return VoxelGrid((r.x_min_m, r.y_min_m, r.z_min_m), self.preset.voxel_size_m, shape)

    def loss_batch(self, inputs: Sequence[LossInput]) -> list[Tensor]:
        """The training loss of each cloud, see `loss`; with frozen batch norm, clouds do not affect each
        other."""
        voxels = self._voxels_of([each.points for each in inputs], [None] * len(inputs))
        return self._losses(self.net(voxels), inputs)

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> OccupancyLoss:
        """The loss as a function of voxel occupancy, see `VoxelDetector.occupancy_loss`.

        With the returned occupancy it equals `loss`; with a voxel at zero, `loss` without that voxel's
        points; with a probe point's voxel at one, `loss` with the probe points there among the points.
        Where most of the map is empty, far cells are left out (`tiles`): gradients correlate by .999 or more.
        """
        return self.occupancy_loss_batch([LossInput(points, boxes, labels, probes)])[0]

    def occupancy_loss_batch(self, inputs: Sequence[LossInput]) -> list[OccupancyLoss]:
        """The results of `occupancy_loss` for each cloud."""
        voxels = self._voxels_of([each.points for each in inputs], [each.probes for each in inputs])
        # A cloud's voxels follow one another, and so do its points, with its probes behind them.
        counts = torch.bincount(voxels.sites.bzyx()[0], minlength=len(inputs)).cpu().tolist()
        sizes = [sum(len(part) for part in (each.points, each.probes) if part is not None) for each in inputs]
        first, rows, occupancies = 0, [], []
        for each, count, row in zip(inputs, counts, torch.split(voxels.point_to_voxel, sizes), strict=True):
            held = voxels.holds_points[first : first + count]
            occupancies.append(held.to(each.points.device, voxels.features.dtype).requires_grad_())
            rows.append(torch.where(row >= 0, row - first, row).to(each.points.device))
            first += count
        together = torch.cat([occupancy.to(self.device) for occupancy in occupancies])
        predictions = self.net.near_voxels(voxels, together)
        found = self.net.decoded(predictions, voxels)
        return list(map(OccupancyLoss, self._losses(predictions, inputs), occupancies, rows, found))

    def _voxels_of(self, clouds: Sequence[Tensor], probes: Sequence[Tensor | None]) -> Voxels:
        given = [
            cloud if extra is None else torch.cat([cloud, extra])
            for cloud, extra in zip(clouds, probes, strict=True)
        ]
        require_finite(given)
        counts = [len(each) - len(cloud) for each, cloud in zip(given, clouds, strict=True)]
        return voxelise([each.to(self.device) for each in given], self.preset, probes=counts)

    def _losses(self, predictions: Predictions, inputs: Sequence[LossInput]) -> list[Tensor]:
        grid = self.net.anchor_grid()
        targets = [grid.assign(each.boxes.to(self.device), each.labels.to(self.device)) for each in inputs]
        found = losses_by_cloud(predictions, targets, grid)
        return [loss.total.to(each.points.device) for loss, each in zip(found, inputs, strict=True)]
