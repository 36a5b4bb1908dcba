"""A detector that finds nothing, at once."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.messages.cloud import Cloud


class BlindDetector:
    classes = ("car", "truck", "cyclist", "pedestrian")
    range_m = Range(-70, -70, -5, 70, 70, 5)

    def detect(self, cloud: Cloud) -> Detections:
        return Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))

    def loss(self, points: object, boxes: object, labels: object) -> object:
        raise AssertionError("evaluating asks for no loss")
