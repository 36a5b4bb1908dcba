"""The density check: more returns are missing somewhere than surfaces of such a brightness lose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.base import DefenderKnowledge, Suspicion
from advpipe.pipeline.attack_detection.range_image import RangeImage, window_sums
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import Cloud

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

MAX_GAP = 4
"""Columns in which the nearest return to the left of a ray, and to its right, is searched."""

SAME_SURFACE_M = 0.3
"""Neighbours whose ranges differ by less than this see one surface."""

RINGS_PER_GROUP = 2
INTENSITIES = np.linspace(0.0, 0.6, 6)[1:]
SURFACES = 4
"""What the loss of returns depends on: a group of neighbouring rings, the intensity around the ray, and
whether the neighbours on both sides return from one surface, from two, one of them returns, or none."""

WINDOW = (5, 11)
"""Rings and columns over which missing returns are counted."""

QUANTILE = 0.9975
"""Of the windows of a cloud; the score is the excess of missing returns that the others exceed."""


class DensityCheck:
    """Counts the missing returns in windows of 5 rings and 11 columns.

    How often a ray does not return is learnt from clean clouds, by its ring and its neighbours. The excess of
    a window is in standard deviations of the expected number; the score is its 99.75 % quantile over all
    windows. It judges no points: they are gone.
    """

    def __init__(self, knowledge: DefenderKnowledge) -> None:
        self._sensor = knowledge.sensor
        self._model = LossModel.learnt([RangeImage.of(cloud, self._sensor) for cloud in knowledge.clean])

    def __call__(self, cloud: Cloud, detections: Detections) -> Suspicion:
        image = RangeImage.of(cloud, self._sensor)
        return Suspicion(float(np.quantile(self._model.excess(image), QUANTILE)))


@dataclass(frozen=True)
class LossModel:
    """How often rays do not return. share: (S,) by the situation of a ray."""

    share: Float64

    @classmethod
    def learnt(cls, clean: list[RangeImage]) -> LossModel:
        """From the range images of clean clouds."""
        situations = [_situations(image) for image in clean]
        size = max(int(each.max()) for each in situations) + 1
        total = sum((np.bincount(each.ravel(), minlength=size) for each in situations), np.zeros(size))
        missing = sum(
            (
                np.bincount(each.ravel(), image.count.ravel() == 0, size)
                for each, image in zip(situations, clean, strict=True)
            ),
            np.zeros(size),
        )
        return cls((missing + 1) / (total + 2))

    def excess(self, image: RangeImage) -> Float64:
        """Of missing returns in the window around each ray (R, C), in standard deviations."""
        missing, spread = self.windows(image)
        over: Float64 = missing / spread
        return over

    def windows(self, image: RangeImage) -> tuple[Float64, Float64]:
        """The excess of missing returns in the window around each ray (R, C), and its standard deviation."""
        share = self.share[np.minimum(_situations(image), len(self.share) - 1)]
        missing = window_sums((image.count == 0) - share, *WINDOW)
        return missing, np.sqrt(window_sums(share * (1 - share), *WINDOW) + 1.0)


def _situations(image: RangeImage) -> Int64:
    """The situation (R, C) of each ray, as a number."""
    (left_m, left), (right_m, right) = (_nearest(image, side) for side in (1, -1))
    apart_m = np.abs(left_m - right_m)
    surface = np.where(apart_m < SAME_SURFACE_M, 0, 1)
    surface[np.isnan(apart_m)] = 2
    surface[np.isnan(left_m) & np.isnan(right_m)] = 3
    intensity = np.where(np.isnan(left), right, np.where(np.isnan(right), left, (left + right) / 2))
    brightness = np.searchsorted(INTENSITIES, np.nan_to_num(intensity))
    group = np.arange(len(image.count))[:, None] // RINGS_PER_GROUP
    number: Int64 = (group * (len(INTENSITIES) + 1) + brightness) * SURFACES + surface
    return number


def _nearest(image: RangeImage, side: int) -> tuple[Float64, Float64]:
    """Range and intensity of the nearest return in the ring on one side, at most `MAX_GAP` columns away."""
    range_m, intensity = np.full_like(image.range_m, np.nan), np.full_like(image.range_m, np.nan)
    for step in range(MAX_GAP, 0, -1):  # the nearest is written last
        at = np.roll(image.range_m, side * step, axis=1)
        seen = np.isfinite(at)
        range_m[seen] = at[seen]
        intensity[seen] = np.roll(image.intensity, side * step, axis=1)[seen]
    return range_m, intensity
