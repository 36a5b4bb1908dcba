"""A trained network as an image detector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.detector.training_maps import KEY, listed_maps
from advpipe.pipeline.image_detector.boxes import best_of_each, pairwise_iou
from advpipe.pipeline.image_detector.network import Cells, ImageNet, with_folded_norms
from advpipe.pipeline.image_detector.protocol import OVERLAP, ImageDetections

LEAST_SCORE = 0.05
"""Scores below it are not reported."""

COARSE_FROM_PX = 60.0
"""Height from which on objects are also found at half the image's size."""

MOST_CANDIDATES, MOST_DETECTIONS = 400, 100
"""Best cells of an image that are looked at, and detections that are reported."""


class NetworkImageDetector:
    """Frozen weights, frozen batch norm; implements `DifferentiableImageDetector`."""

    def __init__(self, net: ImageNet, provenance: Mapping[str, str] | None = None) -> None:
        self.net = net.eval().requires_grad_(False)
        self._folded = with_folded_norms(self.net).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.provenance = dict(provenance or {})

    @property
    def classes(self) -> tuple[str, ...]:
        return self.net.preset.classes

    @property
    def training_maps_sha256(self) -> Sequence[str | None] | None:
        """The maps of the drives it was trained on, see `ReportsTrainingMaps`."""
        return listed_maps(self.provenance.get(KEY))

    @property
    def device(self) -> torch.device:
        return next(self.net.parameters()).device

    def detect(self, image: npt.NDArray[np.uint8]) -> ImageDetections:
        """The objects in an RGB image (H, W, 3), with scores of 0.05 or more."""
        pixels = torch.from_numpy(image.transpose(2, 0, 1).astype(np.float32) / 255)
        with torch.no_grad(), fixed_torch_threads():
            return decode(self._proposals(pixels), LEAST_SCORE)

    def objectness(self, image: Tensor, boxes_px: Tensor, labels: Tensor) -> Tensor:
        """See `DifferentiableImageDetector`."""
        with fixed_torch_threads():
            proposed = self._proposals(image)
            overlap = pairwise_iou(boxes_px.to(proposed.boxes_px), proposed.boxes_px.detach())
            scores = torch.sigmoid(proposed.logits)[labels.to(image.device)]
            highest = overlap.max(1, keepdim=True).values if len(overlap) else overlap
            counts = overlap >= highest.clamp(max=OVERLAP)
            return torch.where(counts, scores, -1.0).max(1).values

    def _proposals(self, image: Tensor) -> Proposals:
        """What the network says of an image (3, H, W), on the image's device: looked at as it is and, for
        high objects, which need a wider view, at half its size."""
        batch = image.to(self.device)[None].contiguous(memory_format=torch.channels_last)
        whole = Proposals.of(self._folded(batch))
        height, width = image.shape[-2:]
        if min(height, width) < 2 * COARSE_FROM_PX / 3:
            return whole.to(image.device)
        coarse = Proposals.of(self._folded(avg_pool2d(batch, 2, ceil_mode=True)))
        limit = torch.tensor([width - 1, height - 1] * 2).to(coarse.boxes_px)
        boxes = torch.minimum(2 * coarse.boxes_px + 0.5, limit)
        high = (boxes[:, 3] - boxes[:, 1]).detach() >= COARSE_FROM_PX
        logits = torch.cat([whole.logits, coarse.logits[:, high]], dim=1)
        return Proposals(logits, torch.cat([whole.boxes_px, boxes[high]])).to(image.device)


@dataclass(frozen=True)
class Proposals:
    """The boxes (N, 4) that the places of an image propose, and their score logits (C, N)."""

    logits: Tensor
    boxes_px: Tensor

    @classmethod
    def of(cls, cells: Cells) -> Proposals:
        """Those of the cells of one image."""
        return cls(cells.logits[0].flatten(1), cells.boxes_px[0].flatten(1).T)

    def to(self, device: torch.device) -> Proposals:
        return Proposals(self.logits.to(device), self.boxes_px.to(device))


def decode(proposed: Proposals, least_score: float) -> ImageDetections:
    """The detections of an image: the best places, without those that repeat a better one."""
    scores, label = torch.sigmoid(proposed.logits).max(0)
    order = torch.argsort(scores, descending=True, stable=True)[:MOST_CANDIDATES]
    order = order[scores[order] >= least_score]
    kept = order[best_of_each(proposed.boxes_px[order], label[order])[:MOST_DETECTIONS]]
    return ImageDetections(proposed.boxes_px[kept].numpy(), scores[kept].numpy(), label[kept].numpy())
