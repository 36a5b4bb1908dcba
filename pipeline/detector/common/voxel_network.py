"""Networks on voxels: occupied voxels to a bird's-eye map, a 2D backbone, and a head."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import torch
from torch import Tensor

from advpipe.pipeline.detector.common.backbone2d import Backbone2d
from advpipe.pipeline.detector.common.network import DetectionNetwork, LabelledPoints
from advpipe.pipeline.detector.common.preset import VoxelPreset
from advpipe.pipeline.detector.common.tiles import MapHead, OccupiedMap
from advpipe.pipeline.detector.common.voxels import OccupiedVoxels
from advpipe.pipeline.detector.protocol import Detections


class HeadOutput(Protocol):
    """What a head predicts, a dataclass of tensors (B, N, ...) in (H, W, A) order."""

    @property
    def scores(self) -> Tensor:
        """(B, N, classes) logits."""


V = TypeVar("V", bound=OccupiedVoxels)
P = TypeVar("P", bound=HeadOutput)


class VoxelNetwork(DetectionNetwork, Generic[V, P]):
    """Each family adds how voxels become a map, and what the head's predictions mean."""

    preset: VoxelPreset
    backbone2d: Backbone2d
    head: MapHead[P]

    @abstractmethod
    def voxels(self, clouds: Sequence[Tensor], probes: Sequence[int] = ()) -> V:
        """The voxels of clouds (N_i, 4), of which so many last points are probe points, see
        `points_by_voxel`."""

    @abstractmethod
    def bird_eye(self, voxels: V, occupancy: Tensor | None) -> Tensor:
        """The bird's-eye map (B, C, H, W); a voxel of occupancy (V,) 0 acts as if it held no point."""

    @abstractmethod
    def occupied_cells(self, voxels: V) -> Tensor:
        """The cells (B, H, W) bool of the bird's-eye map that voxels reach."""

    @abstractmethod
    def cloud_losses(self, predictions: P, b: int, cloud: LabelledPoints) -> tuple[Tensor, ...]:
        """The weighted parts of the loss of cloud `b` of a batch, in the order of `LOSS_PARTS`."""

    @abstractmethod
    def mean_losses(self, predictions: P, targets: Sequence[Any]) -> Tensor:
        """The mean (P,) of `cloud_losses` over a batch of clouds with these `targets`."""

    @abstractmethod
    def cloud_detections(self, predictions: P, b: int) -> Detections:
        """The objects in cloud `b` of a batch."""

    def forward(self, voxels: V, occupancy: Tensor | None = None, bf16: bool = False) -> P:
        """Predictions for the voxels of a batch of clouds; `occupancy` as in `bird_eye`."""
        bev = self.bird_eye(voxels, occupancy)
        with torch.autocast(bev.device.type, torch.bfloat16, enabled=bf16):
            return self.head(self.backbone2d(bev))

    def near_voxels(self, voxels: V, occupancy: Tensor) -> P:
        """As `forward`, with frozen weights; an empty map's predictions far from all voxels, see `tiles`."""
        return self._occupied_map(self.bird_eye(voxels, occupancy), self.occupied_cells(voxels))

    def training_losses(self, cloud: LabelledPoints, *, bf16: bool = False) -> tuple[Tensor, ...]:
        """The gradient reaches the points through the features of their voxel; the assignment of points to
        voxels has no gradient. Without a point in range the loss is that of an empty map, and its gradient
        is zero."""
        return self.cloud_losses(self(self.voxels([cloud.points]), bf16=bf16), 0, cloud)

    def batch_losses(self, clouds: Sequence[LabelledPoints], *, bf16: bool = False) -> Tensor:
        predictions = self(self.voxels([cloud.points for cloud in clouds]), bf16=bf16)
        made = [self.targets(cloud) if cloud.targets is None else cloud.targets for cloud in clouds]
        return self.mean_losses(predictions, made)

    def detections(self, clouds: Sequence[Tensor]) -> list[Detections]:
        """At most `preset.max_detections` in each; points that are not finite are ignored."""
        voxels = self.voxels(clouds)
        return self.decoded(self(voxels), voxels)

    def decoded(self, predictions: P, voxels: V) -> list[Detections]:
        """The objects in each cloud of a batch; none in a cloud without a point in range."""
        count = voxels.sites.batch_size
        held = torch.bincount(voxels.sites.bzyx()[0][voxels.holds_points], minlength=count).cpu().tolist()
        none = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))
        return [self.cloud_detections(predictions, b) if held[b] else none for b in range(count)]

    @cached_property
    def _occupied_map(self) -> OccupiedMap[P]:
        return OccupiedMap(self.backbone2d, self.head)
