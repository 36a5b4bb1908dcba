"""A frozen picture: the last image is shown again and again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from advpipe.pipeline.labels.image_quantities import IMAGE_DELAY, IMAGES_DROPPED, PIXEL_SHARE
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
class CameraFreeze(CameraAttack):
    """Shows the last image before the attack again and again. It comes with the time stamps of the images
    that it hides, so that the stream looks alive.

    An attack from the first image on freezes this one. camera: the name of the attacked one; all of the
    victim without a name.
    """

    traits = CameraTraits()

    camera: str = ""

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return dict.fromkeys((IMAGES_DROPPED.name, IMAGE_DELAY.name, PIXEL_SHARE.name), (0, 0))

    def begin(self, rng: np.random.Generator, drive: CameraDrive) -> ImageAttacker:
        """No draws."""

        def freeze(image: CameraImage, context: ImageContext) -> AttackedImage:
            shown = context.previous or image
            stamped = replace(image.stamped, file=shown.stamped.file, encoding=shown.stamped.encoding)
            return AttackedImage(replace(shown, stamped=stamped))

        return freeze
