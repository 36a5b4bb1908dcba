"""SECOND (Yan, Mao, Li: "SECOND: Sparsely Embedded Convolutional Detection", Sensors 2018)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.protocol import Detections, LossInput, Range, VoxelGrid
from advpipe.pipeline.detector.second.anchors import AnchorGrid
from advpipe.pipeline.detector.second.backbone2d import Backbone2d
from advpipe.pipeline.detector.second.backbone3d import Backbone3d
from advpipe.pipeline.detector.second.decode import detections
from advpipe.pipeline.detector.second.head import Head, Predictions
from advpipe.pipeline.detector.second.loss import losses, losses_by_cloud
from advpipe.pipeline.detector.second.presets import Preset
from advpipe.pipeline.detector.second.voxels import Voxels, voxelise
from advpipe.pipeline.detector.training_maps import KEY, listed
from advpipe.pipeline.messages.cloud import xyzi


class SecondNet(nn.Module):
    """Voxels, sparse 3D backbone, bird's-eye backbone, anchor head."""

    input_offset: Tensor
    input_scale: Tensor

    def __init__(self, preset: Preset) -> None:
        super().__init__()
        self.preset = preset
        self.backbone3d = Backbone3d(preset)
        self.backbone2d = Backbone2d(preset, self.backbone3d.out_channels)
        self.head = Head(preset, self.backbone2d.out_channels)
        self.register_buffer("input_offset", torch.tensor(preset.input_offset), persistent=False)
        self.register_buffer("input_scale", torch.tensor(preset.input_scale), persistent=False)

    def forward(self, voxels: Voxels, occupancy: Tensor | None = None, bf16: bool = False) -> Predictions:
        """Predictions for the voxels of a batch of clouds; `occupancy` (V,) as in `Backbone3d`."""
        features = (voxels.features - self.input_offset) * self.input_scale
        bev = self.backbone3d(features, voxels.sites, occupancy)
        with torch.autocast(bev.device.type, torch.bfloat16, enabled=bf16):
            features = self.backbone2d(bev)
        predictions: Predictions = self.head(features.to(bev.dtype))
        return predictions

    def anchor_grid(self) -> AnchorGrid:
        """The anchors, on the map that the backbones make: one eighth of the voxel grid."""
        _, height, width = self.preset.grid_zyx
        return AnchorGrid(self.preset, height // 8, width // 8, next(self.parameters()).device)


class Second:
    """A trained SECOND as a `BatchDetector`: frozen weights, frozen batch norm.

    It computes where its network is. Tensors may come from anywhere, and those that it returns are where the
    points came from.
    """

    def __init__(self, net: SecondNet, provenance: dict[str, str] | None = None) -> None:
        self.net = net.eval().requires_grad_(False)
        self.preset: Preset = net.preset
        self.provenance = provenance or {}
        self._grid = net.anchor_grid()

    @property
    def training_maps_sha256(self) -> Sequence[str | None] | None:
        """The maps of the drives that it was trained on, as `KnowsItsMaps` has them."""
        return listed(self.provenance.get(KEY))

    @property
    def device(self) -> torch.device:
        return self._grid.x.device

    @property
    def classes(self) -> tuple[str, ...]:
        return self.preset.classes

    @property
    def range_m(self) -> Range:
        return self.preset.range_m

    @property
    def voxel_grid(self) -> VoxelGrid:
        depth, height, width = self.preset.grid_zyx
        r = self.preset.range_m
        shape = (width, height, depth - self.preset.layers_above)
        return VoxelGrid((r.x_min_m, r.y_min_m, r.z_min_m), self.preset.voxel_size_m, shape)

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        """The objects in a cloud (N,), at most `preset.max_detections`; points not finite are not read."""
        return self.detect_batch([torch.from_numpy(xyzi(cloud))])[0]

    @torch.no_grad()
    def detect_batch(self, clouds: Sequence[Tensor]) -> list[Detections]:
        """The objects in each of the clouds (N_i, 4)."""
        voxels = voxelise([cloud.to(self.device) for cloud in clouds], self.preset)
        predictions = self.net(voxels)
        empty = torch.bincount(voxels.sites.bzyx()[0], minlength=len(clouds)) == 0
        none = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
        return [none if empty[b] else detections(predictions, b, self._grid) for b in range(len(clouds))]

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        """The training loss of one cloud, as `Detector.loss`; all boxes in range count.

        The gradient reaches the points through their voxel's mean; which voxel a point falls into
        carries none. Without a readable point the loss is that of an empty map, its gradient zero.
        """
        return self._loss(self._voxels(points), boxes, labels, None).to(points.device)

    def loss_batch(self, inputs: Sequence[LossInput]) -> list[Tensor]:
        """The training loss of each cloud, as `loss`; frozen batch norm keeps them apart."""
        voxels = self._voxels_of([each.points for each in inputs], [None] * len(inputs))
        return self._losses(voxels, inputs, None)

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, ghosts: Tensor | None = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """The loss as a function of voxel occupancy, as `VoxelDetector.occupancy_loss`.

        As returned it is `loss`; with a voxel at zero it is `loss` without that voxel's points, and with a
        ghost's voxel at one it is `loss` with the ghosts there among the points.
        """
        voxels = self._voxels(points, ghosts)
        occupancy = voxels.holds_points.to(points.device, voxels.features.dtype).requires_grad_()
        loss = self._loss(voxels, boxes, labels, occupancy.to(self.device))
        return loss.to(points.device), occupancy, voxels.point_to_voxel.to(points.device)

    def occupancy_loss_batch(self, inputs: Sequence[LossInput]) -> list[tuple[Tensor, Tensor, Tensor]]:
        """What `occupancy_loss` says of each cloud."""
        voxels = self._voxels_of([each.points for each in inputs], [each.ghosts for each in inputs])
        # A cloud's voxels follow one another, and so do its points, with its ghosts behind them.
        counts = torch.bincount(voxels.sites.bzyx()[0], minlength=len(inputs)).tolist()
        sizes = [sum(len(part) for part in (each.points, each.ghosts) if part is not None) for each in inputs]
        first, rows, occupancies = 0, [], []
        for each, count, row in zip(inputs, counts, torch.split(voxels.point_to_voxel, sizes), strict=True):
            held = voxels.holds_points[first : first + count]
            occupancies.append(held.to(each.points.device, voxels.features.dtype).requires_grad_())
            rows.append(torch.where(row >= 0, row - first, row).to(each.points.device))
            first += count
        together = torch.cat([occupancy.to(self.device) for occupancy in occupancies])
        return list(zip(self._losses(voxels, inputs, together), occupancies, rows, strict=True))

    def _voxels(self, points: Tensor, ghosts: Tensor | None = None) -> Voxels:
        return self._voxels_of([points], [ghosts])

    def _voxels_of(self, clouds: Sequence[Tensor], ghosts: Sequence[Tensor | None]) -> Voxels:
        given = [
            cloud if extra is None else torch.cat([cloud, extra])
            for cloud, extra in zip(clouds, ghosts, strict=True)
        ]
        if not all(torch.isfinite(each).all() for each in given):
            raise AdvpipeError(
                "the cloud holds points that are not finite; remove them before asking for a loss"
            )
        counts = [len(each) - len(cloud) for each, cloud in zip(given, clouds, strict=True)]
        return voxelise([each.to(self.device) for each in given], self.preset, ghosts=counts)

    def _loss(self, voxels: Voxels, boxes: Tensor, labels: Tensor, occupancy: Tensor | None) -> Tensor:
        target = self._grid.assign(boxes.to(self.device), labels.to(self.device))
        return losses(self.net(voxels, occupancy), [target], self._grid).total

    def _losses(self, voxels: Voxels, inputs: Sequence[LossInput], occupancy: Tensor | None) -> list[Tensor]:
        targets = [
            self._grid.assign(each.boxes.to(self.device), each.labels.to(self.device)) for each in inputs
        ]
        found = losses_by_cloud(self.net(voxels, occupancy), targets, self._grid)
        return [loss.total.to(each.points.device) for loss, each in zip(found, inputs, strict=True)]
