"""A detector that hands everything on to another one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, Range
from advpipe.pipeline.messages.cloud import Cloud

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class ForwardingDetector:
    """An `ObjectDetector` that answers as another one does; what differs, a subclass says."""

    detector: ObjectDetector

    @property
    def classes(self) -> tuple[str, ...]:
        return self.detector.classes

    @property
    def range_m(self) -> Range:
        return self.detector.range_m

    def detect(self, cloud: Cloud) -> Detections:
        return self.detector.detect(cloud)

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        return self.detector.loss(points, boxes, labels)
