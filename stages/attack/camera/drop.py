"""Dropped frames: images that never arrive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.image_quantities import IMAGE_DELAY, IMAGES_REPLACED, PIXEL_SHARE
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.camera.base import (
    AttackedImage,
    CameraAttack,
    CameraDrive,
    CameraImage,
    CameraTraits,
    ImageAttacker,
    ImageContext,
)


@dataclass(frozen=True, kw_only=True)
class CameraDrop(CameraAttack):
    """Images of a camera never arrive, as when its link is flooded or cut.

    probability: that an image is lost; 1 is a cut. camera: the name of the attacked one; all of the victim
    without a name.
    """

    traits = CameraTraits()

    probability: float = 1.0
    camera: str = ""

    def __post_init__(self) -> None:
        checked_number("camera-drop", "probability", self.probability, 0, 1)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return dict.fromkeys((IMAGE_DELAY.name, IMAGES_REPLACED.name, PIXEL_SHARE.name), (0, 0))

    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """One draw for each image."""

        def drop(image: CameraImage, context: ImageContext) -> AttackedImage:
            return AttackedImage(None if rng.random() < self.probability else image)

        return drop
