"""A trained network on voxels as a detector, with the loss as a function of voxel occupancy."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any, TypeVar

import torch
from torch import Tensor

from advpipe.pipeline.detector.common.network import LabelledPoints, NetworkDetector, require_finite
from advpipe.pipeline.detector.common.voxel_network import VoxelNetwork
from advpipe.pipeline.detector.protocol import LossInput, OccupancyLoss, VoxelGrid

N = TypeVar("N", bound=VoxelNetwork[Any, Any])


class VoxelNetworkDetector(NetworkDetector[N]):
    """A trained network on voxels as a `BatchDetector`."""

    @property
    def voxel_grid(self) -> VoxelGrid:
        """The voxels that the network reads, without the layers that only pad its height."""
        preset = self.net.preset
        depth, height, width = preset.grid_zyx
        r = preset.range_m
        shape = (width, height, depth - preset.layers_above)
        return VoxelGrid((r.x_min_m, r.y_min_m, r.z_min_m), preset.voxel_size_m, shape)

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
        Where most of the map is empty, far cells are left out, see `tiles`.
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
            occupancies.append(held.to(each.points.device, each.points.dtype).requires_grad_())
            rows.append(torch.where(row >= 0, row - first, row).to(each.points.device))
            first += count
        together = torch.cat([occupancy.to(self.device) for occupancy in occupancies])
        predictions = self.net.near_voxels(voxels, together)
        found = self.net.decoded(predictions, voxels)
        return list(map(OccupancyLoss, self._losses(predictions, inputs), occupancies, rows, found))

    def _voxels_of(self, clouds: Sequence[Tensor], probes: Sequence[Tensor | None]) -> Any:
        given = [
            cloud if extra is None else torch.cat([cloud, extra])
            for cloud, extra in zip(clouds, probes, strict=True)
        ]
        require_finite(given)
        counts = [len(each) - len(cloud) for each, cloud in zip(given, clouds, strict=True)]
        return self.net.voxels([each.to(self.device) for each in given], counts)

    def _losses(self, predictions: Any, inputs: Sequence[LossInput]) -> list[Tensor]:
        found = []
        for b, each in enumerate(inputs):
            boxes, labels = each.boxes.to(self.device), each.labels.to(self.device)
            cloud = LabelledPoints(each.points, boxes, labels)
            parts = self.net.cloud_losses(predictions, b, cloud)
            found.append(reduce(torch.add, parts).to(each.points.device))
        return found
