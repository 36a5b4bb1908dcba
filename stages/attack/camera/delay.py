"""Delayed frames: images arrive late."""

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
class CameraDelay(CameraAttack):
    """Images of a camera arrive late. They keep their order and their time stamps, as in a queue that an
    attacker holds up.

    What the queue still holds when the attack ends arrives with the next image; what it holds at the end of
    the drive never arrives. delay_s: by which each image is late. camera: the name of the attacked one; all
    of the victim without a name.
    """

    traits = CameraTraits()

    delay_s: float = 0.5
    camera: str = ""

    def __post_init__(self) -> None:
        checked_number("camera-delay", "delay_s", self.delay_s, 0.001, 60)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {IMAGE_DELAY.name: (0, self.delay_s), IMAGES_REPLACED.name: (0, 0), PIXEL_SHARE.name: (0, 0)}

    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """No draws."""
        delay_ns = round(self.delay_s * 1e9)

        def delay(image: CameraImage, context: ImageContext) -> AttackedImage:
            return AttackedImage(image, delay_ns)

        return delay
