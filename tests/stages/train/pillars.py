"""A second family of detectors, as a newcomer writes one: pillars with one layer, and the common head."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from advpipe.pipeline.detector.common.anchors import AnchorGrid
from advpipe.pipeline.detector.common.backbone2d import Backbone2d
from advpipe.pipeline.detector.common.decode import decode_detections
from advpipe.pipeline.detector.common.head import Head, Predictions
from advpipe.pipeline.detector.common.loss import LOSS_PARTS, losses
from advpipe.pipeline.detector.common.network import DetectionNetwork, LabelledPoints, NetworkDetector
from advpipe.pipeline.detector.common.preset import Anchor, AnchorPreset, BevBlock
from advpipe.pipeline.detector.family import Family
from advpipe.pipeline.detector.protocol import Detections, Range


@dataclass(frozen=True, kw_only=True)
class PillarPreset(AnchorPreset):
    """channels: of a pillar. bev: the blocks of the 2D backbone."""

    family = "pillars"

    channels: int
    bev: tuple[BevBlock, ...]


NARROW = PillarPreset(
    name="narrow",
    range_m=Range(-8.0, -8.0, -3.1, 8.0, 8.0, 2.3),
    voxel_size_m=(0.4, 0.4, 5.4),
    channels=16,
    bev=(BevBlock(1, 1, 32, 1, 32),),
    anchors=(
        Anchor("car", 4.5, 1.85, 1.55, -1.8, 0.6, 0.45),
        Anchor("truck", 5.4, 2.05, 2.3, -1.8, 0.6, 0.45),
    ),
)


class PillarNet(DetectionNetwork):
    """One linear layer on each point, the largest of its pillar, 2D backbone, anchor head."""

    LOSS_PARTS = LOSS_PARTS
    preset: PillarPreset

    def __init__(self, preset: PillarPreset) -> None:
        super().__init__()
        self.preset = preset
        self.layer = nn.Linear(4, preset.channels)
        self.backbone2d = Backbone2d(preset.bev, preset.channels)
        self.head = Head(preset, self.backbone2d.out_channels)

    def forward(self, points: Tensor) -> Predictions:
        r, (dx, dy, _) = self.preset.range_m, self.preset.voxel_size_m
        width, height = round((r.x_max_m - r.x_min_m) / dx), round((r.y_max_m - r.y_min_m) / dy)
        x, y = ((points[:, 0] - r.x_min_m) / dx).long(), ((points[:, 1] - r.y_min_m) / dy).long()
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        features = torch.relu(self.layer(points[inside]))
        cells = (y * width + x)[inside, None].expand_as(features)
        bev = features.new_zeros(height * width, self.preset.channels)
        bev = bev.scatter_reduce(0, cells, features, "amax").view(1, height, width, -1).permute(0, 3, 1, 2)
        predictions: Predictions = self.head(self.backbone2d(bev))
        return predictions

    def grid(self) -> AnchorGrid:
        r, (dx, dy, _) = self.preset.range_m, self.preset.voxel_size_m
        width, height = round((r.x_max_m - r.x_min_m) / dx), round((r.y_max_m - r.y_min_m) / dy)
        return AnchorGrid(self.preset, height, width, self.device)

    def training_losses(self, cloud: LabelledPoints, *, bf16: bool = False) -> tuple[Tensor, ...]:
        target = self.grid().assign(cloud.boxes, cloud.labels, cloud.ignored)
        return losses(self(cloud.points), [target], self.grid()).parts

    def detections(self, clouds: Sequence[Tensor]) -> list[Detections]:
        return [decode_detections(self(cloud), 0, self.grid()) for cloud in clouds]

    def detector(self, provenance: Mapping[str, str]) -> NetworkDetector[PillarNet]:
        return NetworkDetector(self, provenance)


class PillarFamily(Family):
    @property
    def presets(self) -> Mapping[str, PillarPreset]:
        return {"narrow": NARROW}

    def network(self, preset: str) -> PillarNet:
        return PillarNet(self.presets[preset])
