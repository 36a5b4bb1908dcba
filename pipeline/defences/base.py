"""The interface of defences: a defence changes each cloud before detection, and maps detected boxes back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import wrap_angle
from advpipe.pipeline.messages.cloud import Cloud, xyz

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """A defence's transform of the scene: p -> scale * p (with y negated if mirrored) + offset.

    offset_m: (3,) float64.
    """

    scale: float = 1.0
    is_mirrored: bool = False
    offset_m: Float64 = field(default_factory=lambda: np.zeros(3))

    def cloud(self, cloud: Cloud) -> Cloud:
        """The transformed cloud (N,); computed in float64, stored in float32."""
        points = xyz(cloud).astype(np.float64) * (self.scale * self._signs) + self.offset_m
        return with_xyz(cloud, points)

    def boxes_there(self, boxes: Float64) -> Float64:
        """Boxes (M, 7) of the original cloud, where they are in the transformed one."""
        there = boxes.copy()
        there[:, :3] = boxes[:, :3] * (self.scale * self._signs) + self.offset_m
        there[:, 3:6] *= self.scale
        if self.is_mirrored:
            there[:, 6] = wrap_angle(-boxes[:, 6])
        return there

    def followed_by(self, other: Placement) -> Placement:
        """This transform, and then another one."""
        return Placement(
            self.scale * other.scale,
            self.is_mirrored != other.is_mirrored,
            other.scale * other._signs * self.offset_m + other.offset_m,
        )

    def boxes_back(self, boxes: Float64) -> Float64:
        """Boxes (M, 7) detected in the transformed cloud, mapped back to the original cloud."""
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
    """A cloud changed by a defence, and its transform."""

    cloud: Cloud
    placement: Placement = field(default_factory=Placement)


class Defence(Protocol):
    """A defence on clouds. Its constructor takes the parameters, keyword-only, and checks them.

    Each parameter is a number and has a default. One of your own is named `module:Class` or, with parameters,
    `module:Class:radius_m=2`.
    """

    def __call__(self, cloud: Cloud, rng: np.random.Generator) -> DefendedCloud:
        """The cloud (N,) for the detector; the input is not modified.

        Random numbers come from `rng` alone, which is the same for the clean and the adversarial cloud.
        """


class ShippedDefence(Defence, Protocol):
    """A defence of ours. is_default: whether a report has it unless it is asked for others."""

    is_default: ClassVar[bool]


def with_xyz(cloud: Cloud, points: npt.NDArray[np.floating]) -> Cloud:
    """The cloud (N,) with other coordinates (N, 3)."""
    changed = cloud.copy()
    changed["x"], changed["y"], changed["z"] = points.T
    return changed
