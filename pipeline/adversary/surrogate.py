"""A detector of ours that proposes changes against another one, of which an attacker has no gradients.

Detectors that learned the same task rely on the same parts of objects, so that a gradient of one is a better
guess than chance for another (transfer: Papernot et al. 2017, "Practical Black-Box Attacks against Machine
Learning"). A guess it stays: what the attacked detector finds decides about each change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.forwarding import ForwardingDetector
from advpipe.pipeline.detector.protocol import (
    Detections,
    ObjectDetector,
    OccupancyLoss,
    Range,
    VoxelDetector,
    VoxelGrid,
)

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class SurrogateDetector(ForwardingDetector):
    """The attacked detector, which answers queries, with a surrogate beside it, which proposes changes."""

    surrogate: VoxelDetector


@dataclass(frozen=True)
class ProposingDetector:
    """The surrogate as a `VoxelDetector` with the labels of the attacked detector. What it finds itself says
    nothing about that one, so its passes tell no detections."""

    attacked: SurrogateDetector

    @property
    def classes(self) -> tuple[str, ...]:
        return self.attacked.classes

    @property
    def range_m(self) -> Range:
        return self.attacked.surrogate.range_m

    @property
    def voxel_grid(self) -> VoxelGrid:
        return self.attacked.surrogate.voxel_grid

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        return self.attacked.detect(cloud)

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        return self.attacked.surrogate.loss(points, *self._known(boxes, labels))

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> OccupancyLoss:
        computed = self.attacked.surrogate.occupancy_loss(points, *self._known(boxes, labels), probes)
        return replace(computed, found=None)

    def _known(self, boxes: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """The boxes (M, 7) of classes that the surrogate knows, in its range, with its own labels."""
        import torch

        theirs = self.attacked.surrogate.classes
        own = np.array([theirs.index(name) if name in theirs else -1 for name in self.classes], np.int64)
        label = own[labels.cpu().numpy()]
        inside = self.range_m.contains_centres(boxes.detach().cpu().double().numpy())
        kept = np.flatnonzero((label >= 0) & inside)
        return boxes[torch.from_numpy(kept).to(boxes.device)], torch.from_numpy(label[kept]).to(labels.device)


def proposing(detector: ObjectDetector) -> VoxelDetector | None:
    """What proposes changes against a detector without `occupancy_loss`, if it has a surrogate."""
    return ProposingDetector(detector) if isinstance(detector, SurrogateDetector) else None
