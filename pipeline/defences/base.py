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
    """A defence's transform of the scene: p -> scale * p (with y negated if mirrored, then turned about z) +
    offset.

    offset_m: (3,) float64. yaw_rad: of the turn.
    """

    scale: float = 1.0
    is_mirrored: bool = False
    offset_m: Float64 = field(default_factory=lambda: np.zeros(3))
    yaw_rad: float = 0.0

    def cloud(self, cloud: Cloud) -> Cloud:
        """The transformed cloud (N,); computed in float64, stored in float32."""
        return with_xyz(cloud, self._there(xyz(cloud).astype(np.float64)))

    def boxes_there(self, boxes: Float64) -> Float64:
        """Boxes (M, 7) of the original cloud, where they are in the transformed one."""
        there = boxes.copy()
        there[:, :3] = self._there(boxes[:, :3])
        there[:, 3:6] *= self.scale
        if self.is_mirrored or self.yaw_rad:
            there[:, 6] = wrap_angle((-boxes[:, 6] if self.is_mirrored else boxes[:, 6]) + self.yaw_rad)
        return there

    def followed_by(self, other: Placement) -> Placement:
        """This transform, and then another one."""
        return Placement(
            self.scale * other.scale,
            self.is_mirrored != other.is_mirrored,
            other._there(self.offset_m),
            other.yaw_rad + (-self.yaw_rad if other.is_mirrored else self.yaw_rad),
        )

    def boxes_back(self, boxes: Float64) -> Float64:
        """Boxes (M, 7) detected in the transformed cloud, mapped back to the original cloud."""
        back = boxes.copy()
        back[:, :3] = _turned(boxes[:, :3] - self.offset_m, -self.yaw_rad) / (self.scale * self._signs)
        back[:, 3:6] /= self.scale
        if self.is_mirrored or self.yaw_rad:
            unturned = boxes[:, 6] - self.yaw_rad
            back[:, 6] = wrap_angle(-unturned if self.is_mirrored else unturned)
        return back

    def _there(self, places: Float64) -> Float64:
        """Places (..., 3) of the original cloud in the transformed one."""
        return _turned(places * (self.scale * self._signs), self.yaw_rad) + self.offset_m

    @property
    def _signs(self) -> Float64:
        return np.array([1.0, -1.0 if self.is_mirrored else 1.0, 1.0])


def _turned(places: Float64, yaw_rad: float) -> Float64:
    """Places (..., 3) turned about z."""
    if not yaw_rad:
        return places
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turned: Float64 = places @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return turned


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
