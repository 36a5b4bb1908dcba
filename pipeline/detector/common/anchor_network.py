"""Networks on voxels with an anchor head."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TypeVar

import torch
from torch import Tensor

from advpipe.pipeline.detector.common.anchors import AnchorGrid, Targets
from advpipe.pipeline.detector.common.decode import decode_detections
from advpipe.pipeline.detector.common.head import Predictions
from advpipe.pipeline.detector.common.loss import LOSS_PARTS, cloud_losses, losses
from advpipe.pipeline.detector.common.network import LabelledPoints
from advpipe.pipeline.detector.common.preset import AnchorVoxelPreset
from advpipe.pipeline.detector.common.voxel_network import VoxelNetwork
from advpipe.pipeline.detector.common.voxels import OccupiedVoxels
from advpipe.pipeline.detector.protocol import Detections

V = TypeVar("V", bound=OccupiedVoxels)


class AnchorNetwork(VoxelNetwork[V, Predictions]):
    """Its losses and detections are those of its anchors."""

    LOSS_PARTS = LOSS_PARTS
    preset: AnchorVoxelPreset
    _grid: AnchorGrid | None = None

    @property
    @abstractmethod
    def voxels_per_cell(self) -> int:
        """Voxels along the side of a cell of the predictions."""

    def anchor_grid(self) -> AnchorGrid:
        """The anchors at the cells of the predictions."""
        if self._grid is None or self._grid.x.device != self.device:
            _, height, width = self.preset.grid_zyx
            cell = self.voxels_per_cell
            self._grid = AnchorGrid(self.preset, height // cell, width // cell, self.device)
        return self._grid

    def cloud_losses(self, predictions: Predictions, b: int, cloud: LabelledPoints) -> tuple[Tensor, ...]:
        return cloud_losses(predictions, b, self.targets(cloud), self.anchor_grid()).parts

    def targets(self, cloud: LabelledPoints) -> Targets:
        return self.anchor_grid().assign(cloud.boxes, cloud.labels, cloud.ignored, cloud.uncounted)

    def mean_losses(self, predictions: Predictions, targets: Sequence[Targets]) -> Tensor:
        return torch.stack(losses(predictions, targets, self.anchor_grid()).parts)

    def cloud_detections(self, predictions: Predictions, b: int) -> Detections:
        return decode_detections(predictions, b, self.anchor_grid())
