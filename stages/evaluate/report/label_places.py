"""Where the labels of neighbouring objects stand in a picture, so that none covers another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]

GAPS = (2.0, 10.0, 20.0, 32.0, 46.0, 62.0)
"""Distances from the object that are tried, in the unit of the sizes."""

DIRECTIONS = ((0, -1), (0, 1), (1, 0), (-1, 0), (1, -1), (-1, -1), (1, 1), (-1, 1))
"""Below the object first, then above it, right, left and in the corners."""

ON_LABEL, ON_OBJECT, OUTSIDE = 100.0, 1.0, 100.0
"""What an overlap costs, by its share of the label; a step away from the object costs `PER_STEP`."""

PER_STEP = 0.15


def place_labels(objects: Float64, sizes: Float64, obstacles: Float64, panel: tuple[float, float]) -> Float64:
    """The centres (N, 2) of labels, each near its object; greedy, in the order of the objects.

    objects: (N, 4) rectangles left, bottom, right, top; sizes: (N, 2) widths and heights of their labels;
    obstacles: (K, 4) rectangles that labels should leave free; panel: width and height, from (0, 0).
    """
    placed = np.zeros((0, 4))
    centres = np.zeros((len(objects), 2))
    for number, (own, size) in enumerate(zip(objects, sizes, strict=True)):
        candidates = _candidates(own, size)
        rectangles = np.hstack([candidates - size / 2, candidates + size / 2])
        area = float(np.prod(size))
        inside = _overlaps(rectangles, np.array([[0.0, 0.0, *panel]]))
        cost = (
            ON_LABEL * _overlaps(rectangles, placed)
            + ON_OBJECT * _overlaps(rectangles, obstacles)
            + OUTSIDE * (area - inside)
        ) / area + PER_STEP * np.repeat(np.arange(len(GAPS)), len(DIRECTIONS))
        best = int(np.argmin(cost))
        centres[number] = candidates[best]
        placed = np.vstack([placed, rectangles[best : best + 1]])
    return centres


def _candidates(own: Float64, size: Float64) -> Float64:
    """(C, 2): all directions at the first gap, then at the next."""
    middle, half = (own[:2] + own[2:]) / 2, (own[2:] - own[:2]) / 2
    directions = np.array(DIRECTIONS, np.float64)
    return np.concatenate([middle + directions * (half + size / 2 + gap) for gap in GAPS])


def _overlaps(rectangles: Float64, others: Float64) -> Float64:
    """The area (C,) that each rectangle shares with all others together."""
    low = np.maximum(rectangles[:, None, :2], others[None, :, :2])
    high = np.minimum(rectangles[:, None, 2:], others[None, :, 2:])
    shared: Float64 = np.prod(np.clip(high - low, 0, None), axis=2).sum(axis=1)
    return shared
