"""The interface of 2D detectors on camera images; `small` is the shipped one, users plug in their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class ImageDetections:
    """M detections in one image, best first.

    boxes_px: (M, 4) float32, left, top, right, bottom in pixels; the centre of the image's top left pixel is
    (0, 0), as in KITTI's labels and in those of bags.
    scores: (M,) float32 in [0, 1].
    labels: (M,) int64, index into the detector's own `classes`.
    """

    boxes_px: npt.NDArray[np.float32]
    scores: npt.NDArray[np.float32]
    labels: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.boxes_px)


@runtime_checkable
class ImageDetector(Protocol):
    """A 2D detector on images of any size; enough for `advpipe evaluate`."""

    @property
    def classes(self) -> tuple[str, ...]:
        """The classes that it detects, each one of `geometry.boxes.CLASSES`."""

    def detect(self, image: npt.NDArray[np.uint8]) -> ImageDetections:
        """The objects in an RGB image (H, W, 3)."""


@runtime_checkable
class DifferentiableImageDetector(ImageDetector, Protocol):
    """A detector whose scores can be differentiated with respect to the image, which attacks need."""

    def objectness(self, image: Tensor, boxes_px: Tensor, labels: Tensor) -> Tensor:
        """How surely each of the given objects is detected: (M,) in [0, 1], low for a hidden one.

        The highest score of the object's class among all places that propose a box overlapping the given one
        with an IoU of `OVERLAP` or more, before any threshold or suppression of neighbours; where none does,
        the score of the place whose box overlaps most. The choice of the place counts as constant: the
        gradient is that of its score.

        image: (3, H, W) float32 RGB in 0 to 1; boxes_px: (M, 4) float32 as in `ImageDetections`;
        labels: (M,) int64, index into `classes`. On the CPU, whatever device it computes on.
        """


OVERLAP = 0.3
"""IoU from which on a proposed box counts as one of the given object."""
