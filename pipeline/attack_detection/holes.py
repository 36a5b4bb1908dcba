"""Holes in surfaces: rays that do not return although those on both sides return from one surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.range_image import RangeImage

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]

SAME_SURFACE_M = 0.4
"""Neighbours on both sides of a ray whose ranges differ by less see one surface."""

BRIGHT = 0.4
"""Of the middle intensity of a cloud: from darker surfaces, rays vanish by themselves."""


class SurfaceHoles(NamedTuple):
    """Rays (R, C) whose neighbours left and right, or above and below, return from one bright surface, and
    those of them that do not return: what an attack that removes single points leaves behind."""

    surface: Bool
    holes: Bool


def surface_holes(image: RangeImage) -> SurfaceHoles:
    """Those of a range image."""
    seen = image.intensity[np.isfinite(image.intensity)]
    bright = BRIGHT * float(np.median(seen)) if len(seen) else 0.0
    beside = _is_surface(_shifted(image, 0, 1), _shifted(image, 0, -1), bright)
    above = _is_surface(_shifted(image, 1, 0), _shifted(image, -1, 0), bright)
    surface: Bool = beside | above
    return SurfaceHoles(surface, surface & (image.count == 0))


def _is_surface(one: tuple[Float64, Float64], other: tuple[Float64, Float64], bright: float) -> Bool:
    is_bright = (one[1] >= bright) & (other[1] >= bright)
    together: Bool = (np.abs(one[0] - other[0]) < SAME_SURFACE_M) & is_bright
    return together


def _shifted(image: RangeImage, rows: int, columns: int) -> tuple[Float64, Float64]:
    """Range and intensity of the ray beside each; NaN beyond the outermost rings."""
    found = []
    for values in (image.range_m, image.intensity):
        moved = np.roll(values, (rows, columns), (0, 1))
        if rows:
            moved[0 if rows > 0 else -1] = np.nan
        found.append(moved)
    return found[0], found[1]
