"""Pictures that the world itself takes, such as those of another simulator's cameras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.sensors.camera.picture import Layers


@dataclass(frozen=True)
class Picture:
    """One camera's pictures at one instant. rgb: (H, W, 3) uint8, None where it records none. layers: of the
    same pixels; objects index the boxes that were asked for."""

    rgb: npt.NDArray[np.uint8] | None
    layers: Layers


@runtime_checkable
class PicturingSurroundings(Protocol):
    """The surroundings in a world that offers "pictures"."""

    def picture(self, name: str, boxes: Boxes) -> Picture:
        """What the vehicle's camera `name` has taken now, among these road users of `road_users`."""
        ...
