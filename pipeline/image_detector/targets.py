"""What the head is to learn from the objects of a picture, as in TTFNet (Liu et al., AAAI 2020)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.image_detector.network import STRIDE

SHARE = 0.54
"""Share of an object's box around its centre whose cells learn from it; the paper's alpha."""

Float32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class PictureObjects:
    """The M objects in a picture. boxes_px: (M, 4) float32. labels: (M,) int64. is_learned: (M,) bool; cells
    in the middle of the others learn neither that something is there nor that nothing is."""

    boxes_px: Float32
    labels: npt.NDArray[np.int64]
    is_learned: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Targets:
    """heat: (C, h, w), 1 in an object's middle, falling to 0 as a Gaussian; NaN where nothing is learned.
    boxes_px: (4, h, w) of the object that a cell learns from; weights: (h, w), 0 where it learns none."""

    heat: Float32
    boxes_px: Float32
    weights: Float32


def targets_of(objects: PictureObjects, n_classes: int, rows: int, columns: int) -> Targets:
    """The targets of a picture with this many rows and columns of cells.

    Where objects share a cell it learns the box of the smaller one. Weights of an object sum to the logarithm
    of its area in square cells, plus 1.
    """
    heat = np.zeros((n_classes, rows, columns), np.float32)
    boxes, weights = np.zeros((4, rows, columns), np.float32), np.zeros((rows, columns), np.float32)
    sizes = objects.boxes_px[:, 2:] - objects.boxes_px[:, :2] + 1
    order = np.lexsort((-sizes.prod(axis=1), objects.is_learned))  # those not learned, then large ones, first
    for index in order:
        box, label = objects.boxes_px[index], objects.labels[index]
        (top, bottom, left, right), bump = _bump(box, rows, columns)
        area = heat[label, top:bottom, left:right]
        if not objects.is_learned[index]:
            area[bump > 0] = np.nan
            continue
        area[...] = np.fmax(area, bump)
        is_inside = bump > 0
        boxes[:, top:bottom, left:right][:, is_inside] = box[:, None]
        amount = 1 + np.log(max(float(sizes[index].prod()) / STRIDE**2, 1.0))
        weights[top:bottom, left:right][is_inside] = (bump * (amount / bump.sum()))[is_inside]
    return Targets(heat, boxes, weights)


def _bump(box: Float32, rows: int, columns: int) -> tuple[tuple[int, int, int, int], Float32]:
    """The cells around the middle of a box, as first and end of rows and columns, and their values."""
    middle = np.clip(np.floor((box[:2] + box[2:] + 1) / 2 / STRIDE), 0, (columns - 1, rows - 1)).astype(int)
    reach = np.floor((box[2:] - box[:2] + 1) / STRIDE / 2 * SHARE).astype(int)
    deviation = (2 * reach + 1) / 6
    x, y = (np.arange(-r, r + 1) for r in reach.tolist())
    values = np.exp(-(x[None] ** 2) / (2 * deviation[0] ** 2) - y[:, None] ** 2 / (2 * deviation[1] ** 2))
    left, top = (middle - reach).tolist()
    cut_left, cut_top = max(0, -left), max(0, -top)
    right, bottom = min(columns, left + len(x)), min(rows, top + len(y))
    cut = values[cut_top : bottom - top, cut_left : right - left].astype(np.float32)
    return (top + cut_top, bottom, left + cut_left, right), cut
