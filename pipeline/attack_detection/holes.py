"""Holes in surfaces: rays that do not return although those on both sides return from one surface."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.range_image import RangeImage

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]

SAME_SURFACE_M = 0.4
"""Neighbours on both sides of a ray whose ranges differ by less see one surface."""


def surface_holes(image: RangeImage) -> Bool:
    """Which rays (R, C) do not return though their neighbours left and right, or above and below, do, from
    one surface: what an attack that removes single points leaves behind."""
    beside = np.abs(np.roll(image.range_m, 1, axis=1) - np.roll(image.range_m, -1, axis=1))
    above = np.full_like(image.range_m, np.nan)
    above[1:-1] = np.abs(image.range_m[2:] - image.range_m[:-2])
    holes: Bool = (image.count == 0) & ((beside < SAME_SURFACE_M) | (above < SAME_SURFACE_M))
    return holes
