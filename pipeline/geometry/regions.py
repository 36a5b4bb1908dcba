"""Convex parts of space, such as a camera's view: where the objects of a recording are labelled."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64

Bool: TypeAlias = npt.NDArray[np.bool_]

_NEAREST_M = 0.0
"""Depth from which a camera sees."""


@dataclass(frozen=True)
class ConvexRegion:
    """The points on the inner side of P planes.

    planes: (P, 4) float64, columns a, b, c, d: a point is inside where a x + b y + c z + d >= 0 for all.
    max_range_m: largest horizontal distance from the frame's origin; infinite for no limit.
    """

    name: str
    planes: Float64 = field(default_factory=lambda: np.zeros((0, 4)))
    max_range_m: float = np.inf

    def contains(self, points_m: Float64) -> Bool:
        """Which of the points (N, 3) lie inside: (N,)."""
        points_m = np.asarray(points_m, np.float64).reshape(-1, 3)
        above: Bool = np.all(points_m @ self.planes[:, :3].T + self.planes[:, 3] >= 0, axis=1)
        return above & (np.hypot(points_m[:, 0], points_m[:, 1]) <= self.max_range_m)

    def transformed(self, a_SE3_b: Float64) -> ConvexRegion:
        """The same region, given in frame b, in frame a; a limit of the range then counts from a's origin."""
        return ConvexRegion(self.name, self.planes @ np.linalg.inv(a_SE3_b), self.max_range_m)


@dataclass(frozen=True)
class LabelCoverage:
    """Where objects are labelled.

    labelled: any of them; none stands for everywhere. ignored: neither objects nor detections count inside.
    """

    labelled: tuple[ConvexRegion, ...] = ()
    ignored: tuple[ConvexRegion, ...] = ()

    def counts(self, points_m: Float64) -> Bool:
        """Whether an object or detection centred at each of the points (N, 3) counts: (N,)."""
        inside = [region.contains(points_m) for region in self.labelled]
        counted: Bool = np.any(inside, axis=0) if inside else np.ones(len(points_m), bool)
        for region in self.ignored:
            counted &= ~region.contains(points_m)
        return counted

    def transformed(self, a_SE3_b: Float64) -> LabelCoverage:
        """The same coverage, given in frame b, in frame a."""
        return LabelCoverage(
            tuple(region.transformed(a_SE3_b) for region in self.labelled),
            tuple(region.transformed(a_SE3_b) for region in self.ignored),
        )


def image_region(
    name: str, image_P_frame: Float64, left: float, top: float, right: float, bottom: float
) -> ConvexRegion:
    """All that a rectangle of an image shows.

    image_P_frame: projection (3, 4) from a frame to homogeneous pixels, whose third row is the depth.
    left, top, right, bottom: edges of the rectangle in pixels.
    """
    u, v, depth = np.asarray(image_P_frame, np.float64)
    near = depth - np.array([0, 0, 0, _NEAREST_M])
    planes = np.stack([near, u - left * depth, right * depth - u, v - top * depth, bottom * depth - v])
    return ConvexRegion(name, planes)
