"""The occlusion check: a ray returns once, and no surface is seen through another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion
from advpipe.pipeline.attack_detection.range_image import RangeImage
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import Cloud

Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

SURFACE_M = 0.5
"""A return this much nearer or farther than all of its neighbours is of another surface than theirs."""


class OcclusionOrderCheck:
    """Counts returns that stand behind another one on the same ray, and returns that all eight rays around
    theirs stop before.

    Both returns of a ray are taken for changed, as one of them is. The score is the number of such points.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        self._sensor = knowledge.sensor

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        image = RangeImage.of(cloud, self._sensor)
        suspicious = (image.count > 1) | seen_through(image.range_m)
        points = np.zeros(len(cloud), bool)
        has_ray = image.ray >= 0
        points[has_ray] = suspicious.flat[image.ray[has_ray]]
        return Suspicion(float(points.sum()), points=points)


def seen_through(range_m: Float64) -> Bool:
    """Which returns (R, C) lie behind all of their eight neighbours, every one of which returns."""
    behind: Bool = range_m > np.max(_neighbours(range_m), axis=0) + SURFACE_M  # False where one is NaN
    return behind


def farthest_neighbour(range_m: Float64) -> Float64:
    """The range of the farthest of the neighbours of each ray (R, C) that return; infinite if none does."""
    farthest: Float64 = np.fmax.reduce(_neighbours(range_m))
    return np.where(np.isnan(farthest), np.inf, farthest)


def _neighbours(range_m: Float64) -> list[Float64]:
    """The ranges (R, C) of each of the eight rays around every ray; NaN beyond the outermost rings."""
    padded = np.pad(np.pad(range_m, ((1, 1), (0, 0)), constant_values=np.nan), ((0, 0), (1, 1)), mode="wrap")
    rows, columns = range_m.shape
    return [
        padded[row : row + rows, column : column + columns]
        for row in range(3)
        for column in range(3)
        if (row, column) != (1, 1)
    ]
