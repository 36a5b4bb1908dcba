"""Stands for the detector of attacks that query none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import Detections, Range

if TYPE_CHECKING:
    from torch import Tensor


class NoDetector:
    """Covers nothing and finds nothing, at no cost."""

    classes: tuple[str, ...] = ("car",)
    range_m = Range(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        """Nothing."""
        return Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        """Zero, with no gradient."""
        return points.sum() * 0.0
