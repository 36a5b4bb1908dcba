"""A trained network as an image detector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.detector.training_maps import KEY, listed_maps
from advpipe.pipeline.image_detector.boxes import best_of_each, pairwise_iou
from advpipe.pipeline.image_detector.network import Cells, ImageNet, with_folded_norms
from advpipe.pipeline.image_detector.protocol import OVERLAP, ImageDetections

LEAST_SCORE = 0.05
"""Scores below it are not reported."""

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
            cells = self._cells(pixels)
            return decode(cells, LEAST_SCORE)

    def objectness(self, image: Tensor, boxes_px: Tensor, labels: Tensor) -> Tensor:
        """See `DifferentiableImageDetector`."""
        with fixed_torch_threads():
            cells = self._cells(image)
            proposed = cells.boxes_px[0].flatten(1).T.detach()
            overlap = pairwise_iou(boxes_px.to(proposed), proposed)
            scores = torch.sigmoid(cells.logits[0].flatten(1))[labels.to(proposed.device)]
            highest = overlap.max(1, keepdim=True).values if len(overlap) else overlap
            counts = overlap >= highest.clamp(max=OVERLAP)
            found = torch.where(counts, scores, -1.0).max(1).values
            return found.to(image.device)

    def _cells(self, image: Tensor) -> Cells:
        batch = image.to(self.device)[None].contiguous(memory_format=torch.channels_last)
        cells: Cells = self._folded(batch)
        return cells


def decode(cells: Cells, least_score: float) -> ImageDetections:
    """The detections of the first image: the best cells, without those that repeat a better one."""
    scores, label = torch.sigmoid(cells.logits[0]).flatten(1).max(0)
    order = torch.argsort(scores, descending=True, stable=True)[:MOST_CANDIDATES]
    order = order[scores[order] >= least_score]
    boxes = cells.boxes_px[0].flatten(1).T[order]
    kept = order[best_of_each(boxes.cpu(), label[order].cpu())[:MOST_DETECTIONS].to(order.device)]
    return ImageDetections(
        cells.boxes_px[0].flatten(1).T[kept].cpu().numpy(),
        scores[kept].cpu().numpy(),
        label[kept].cpu().numpy(),
    )
