"""Heat and codes to a short list of boxes."""

from __future__ import annotations

import torch

from advpipe.pipeline.detector.centerpoint.head import CentrePredictions
from advpipe.pipeline.detector.centerpoint.targets import CentreGrid
from advpipe.pipeline.detector.common.decode import SCORE_THRESHOLD, rated, suppressed_detections
from advpipe.pipeline.detector.protocol import Detections


@torch.no_grad()
def decode_centres(predictions: CentrePredictions, b: int, grid: CentreGrid) -> Detections:
    """The boxes of cloud `b` at the cells where a class scores at least 0.1, best first.

    A box whose centre lies out of the range is no candidate. Where the head predicts the quality of
    boxes, scores are those of `rated`.
    """
    preset, r = grid.preset, grid.preset.range_m
    of_classes = torch.sigmoid(predictions.scores[b])
    cells, labels = (of_classes >= SCORE_THRESHOLD).nonzero().unbind(1)
    scores = of_classes[cells, labels]
    if predictions.qualities is not None and preset.quality_power is not None:
        scores = rated(scores, predictions.qualities[b][cells], preset.quality_power)
    order = torch.sort(scores, descending=True, stable=True).indices[: preset.max_candidates]
    boxes = grid.decode(predictions.codes[b][cells[order]], cells[order])
    low = boxes.new_tensor([r.x_min_m, r.y_min_m, r.z_min_m])
    high = boxes.new_tensor([r.x_max_m, r.y_max_m, r.z_max_m])
    inside = ((boxes[:, :3] >= low) & (boxes[:, :3] <= high)).all(1)
    chosen = order[inside]
    return suppressed_detections(boxes[inside], scores[chosen], labels[chosen], preset)
