"""CenterPoint's first stage (Yin, Zhou, Krähenbühl: "Center-based 3D Object Detection and Tracking", CVPR
2021) on SECOND's backbones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from advpipe.pipeline.detector.centerpoint.decode import decode_centres
from advpipe.pipeline.detector.centerpoint.head import CentreHead, CentrePredictions
from advpipe.pipeline.detector.centerpoint.loss import CENTRE_LOSS_PARTS, centre_losses
from advpipe.pipeline.detector.centerpoint.presets import CenterPointPreset
from advpipe.pipeline.detector.centerpoint.targets import CentreGrid, CentreTargets
from advpipe.pipeline.detector.common.network import LabelledPoints
from advpipe.pipeline.detector.common.sparse_network import SparseNetwork
from advpipe.pipeline.detector.common.voxel_detector import VoxelNetworkDetector
from advpipe.pipeline.detector.protocol import Detections


class CenterPointNet(SparseNetwork[CentrePredictions]):
    """Voxels, sparse 3D backbone, bird's-eye backbone, centre head."""

    LOSS_PARTS = CENTRE_LOSS_PARTS
    preset: CenterPointPreset
    _grid: CentreGrid | None = None

    def __init__(self, preset: CenterPointPreset) -> None:
        super().__init__(preset)
        self.head = CentreHead(preset, self.backbone2d.out_channels)

    def centre_grid(self) -> CentreGrid:
        """The cells of the predictions."""
        if self._grid is None or self._grid.low_m.device != self.device:
            _, height, width = self.preset.grid_zyx
            cell = self.voxels_per_cell
            self._grid = CentreGrid(self.preset, height // cell, width // cell, self.device)
        return self._grid

    def cloud_losses(
        self, predictions: CentrePredictions, b: int, cloud: LabelledPoints
    ) -> tuple[Tensor, ...]:
        return centre_losses(predictions, b, self.targets(cloud), self.centre_grid())

    def targets(self, cloud: LabelledPoints) -> CentreTargets:
        return self.centre_grid().assign(cloud.boxes, cloud.labels, cloud.ignored, cloud.uncounted)

    def mean_losses(self, predictions: CentrePredictions, targets: Sequence[CentreTargets]) -> Tensor:
        grid = self.centre_grid()
        parts = [centre_losses(predictions, b, target, grid) for b, target in enumerate(targets)]
        return torch.stack([torch.stack(each) for each in parts]).mean(0)

    def cloud_detections(self, predictions: CentrePredictions, b: int) -> Detections:
        return decode_centres(predictions, b, self.centre_grid())

    def detector(self, provenance: Mapping[str, str]) -> VoxelNetworkDetector[CenterPointNet]:
        return VoxelNetworkDetector(self, provenance)
