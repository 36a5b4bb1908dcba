"""What a defence is: a change of every cloud before the detector sees it, and the way back for its boxes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import wrap_angle
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """Where a defence puts the world: p -> scale * p, mirrored in y if so, + offset.

    offset_m: (3,) float64.
    """

    scale: float = 1.0
    is_mirrored: bool = False
    offset_m: Float64 = field(default_factory=lambda: np.zeros(3))

    def cloud(self, cloud: Cloud) -> Cloud:
        """The cloud (N,) in its new place; computed in float64, stored in float32."""
        points = xyz(cloud).astype(np.float64) * (self.scale * self._signs) + self.offset_m
        return with_xyz(cloud, points)

    def boxes_back(self, boxes: Float64) -> Float64:
        """Boxes (M, 7) found in the new place, where they belong in the cloud that was given."""
        back = boxes.copy()
        back[:, :3] = (boxes[:, :3] - self.offset_m) / (self.scale * self._signs)
        back[:, 3:6] /= self.scale
        if self.is_mirrored:
            back[:, 6] = wrap_angle(-boxes[:, 6])
        return back

    @property
    def _signs(self) -> Float64:
        return np.array([1.0, -1.0 if self.is_mirrored else 1.0, 1.0])


@dataclass(frozen=True)
class DefendedCloud:
    """A cloud as a defence leaves it, and where it lies now."""

    cloud: Cloud
    placement: Placement = field(default_factory=Placement)


class Defence(Protocol):
    """A defence on clouds. Its constructor takes the parameters, keyword-only, and checks them."""

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        """The cloud (N,) as the detector is to see it; the one that is given stays as it is."""


def with_xyz(cloud: Cloud, points: npt.NDArray[np.floating]) -> Cloud:
    """The cloud (N,) with other coordinates (N, 3)."""
    changed = cloud.copy()
    changed["x"], changed["y"], changed["z"] = points.T
    return changed
