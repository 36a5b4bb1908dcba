"""A 2D detector of the tests' own, as a user would write one: vehicles are what is redder than the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.image_detector.protocol import ImageDetections

if TYPE_CHECKING:
    from torch import Tensor

SIDE, GAIN, LEAST = 7, 12.0, 0.05


class RedDetector:
    """Convolves redness with a window; an object's score follows from its mean in the object's box."""

    classes = ("car", "truck")

    def detect(self, image: npt.NDArray[np.uint8]) -> ImageDetections:
        """One box around everything that is red."""
        import torch

        red = self._red(torch.from_numpy(image).permute(2, 0, 1).float() / 255).numpy()
        rows, columns = np.nonzero(red > LEAST)
        if not len(rows):
            return ImageDetections(
                np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int64)
            )
        box = np.array([[columns.min(), rows.min(), columns.max(), rows.max()]], np.float32)
        return ImageDetections(box, np.ones(1, np.float32), np.zeros(1, np.int64))

    def objectness(self, image: Tensor, boxes_px: Tensor, labels: Tensor) -> Tensor:
        """See `DifferentiableImageDetector`."""
        import torch

        red, scores = self._red(image), []
        for left, top, right, bottom in boxes_px.round().int().tolist():
            scores.append(torch.sigmoid(GAIN * red[top : bottom + 1, left : right + 1].mean()))
        return torch.stack(scores)

    def _red(self, image: Tensor) -> Tensor:
        import torch

        kernel = torch.tensor([1.0, -0.5, -0.5]).reshape(1, 3, 1, 1).repeat(1, 1, SIDE, SIDE) / SIDE**2
        return torch.nn.functional.conv2d(image[None], kernel, padding=SIDE // 2)[0, 0]


class Blind:
    """A detector without gradients."""

    classes = ("car",)

    def detect(self, image: npt.NDArray[np.uint8]) -> ImageDetections:
        raise NotImplementedError


class Broken(RedDetector):
    """A detector with a mistake."""

    def objectness(self, image: Tensor, boxes_px: Tensor, labels: Tensor) -> Tensor:
        return image / (1 // 0)
