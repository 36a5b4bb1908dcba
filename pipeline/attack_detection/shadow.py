"""The shadow of a box, which a real object keeps free of returns (Hau et al. 2021, section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.rehearsal import MOST_SPOOFED_POINTS, evenly
from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.geometry.transforms import wrap_angle

Float64 = npt.NDArray[np.float64]

DECAY = 0.2
"""The paper's alpha: weights halve with each such part of the way through a shadow, and across it."""

MAX_LENGTH_M = 40.0
"""Of the shadows of objects that are as high as the sensor."""

NEAR_PART, MIDDLE_PART, LOW_M = 0.2, 0.5, 1.0
"""Where returns invalidate a shadow most: at its beginning, about its middle line, near the ground."""


@dataclass(frozen=True)
class PolarPoints:
    """Returns (N,) as seen from the sensor: height, distance in the plane, azimuth; points: (N, 3)."""

    points: Float64
    height_m: Float64
    flat_m: Float64
    azimuth_rad: Float64

    @classmethod
    def of(cls, points: Float64) -> PolarPoints:
        """Those of points (N, 3)."""
        x, y, z = points.T
        return cls(points, z, np.hypot(x, y), np.arctan2(y, x))


@dataclass(frozen=True)
class ShadowReturns:
    """The returns (K, 3) in a shadow, and their ways (K,) along it and from its middle to its side, in
    [0, 1]."""

    points: Float64
    along: Float64
    across: Float64

    @property
    def score(self) -> float:
        """The anomaly score: the mean weight of the returns, scaled to [0, 1]; 0 without returns.

        A return weighs exp(ln(0.5) / alpha * x) for its way x along the shadow, and again for its way across:
        returns deep behind an object or at its edge may be of something else.
        """
        if not len(self.points):
            return 0.0
        weight = np.exp(np.log(0.5) / DECAY * (self.across + self.along))
        least = np.exp(2 * np.log(0.5) / DECAY)
        return float((weight.mean() - least) / (1 - least))

    def and_others(self, others: ShadowReturns) -> ShadowReturns:
        """These and others of the same shadow."""
        return ShadowReturns(
            np.concatenate([self.points, others.points]),
            np.concatenate([self.along, others.along]),
            np.concatenate([self.across, others.across]),
        )


@dataclass(frozen=True)
class Shadow:
    """The space behind a box, between the two rays past its outermost corners, below the ray over its top.

    It begins at the distance of the farthest corner and ends where the ray over the top meets the ground:
    length = distance * h / (H - h), for an object of height h and a sensor of height H. azimuth_rad: of its
    middle line; half_rad: from there to its side. top_slope: of the ray over the box's top.
    """

    first_m: float
    length_m: float
    azimuth_rad: float
    half_rad: float
    top_slope: float

    @classmethod
    def of(cls, box: Float64, ground_m: float) -> Shadow:
        """The shadow of a box (7,) over ground of this height, from the sensor."""
        corners = box_corners(box[None])[0, :4, :2]
        corner_m = np.hypot(corners[:, 0], corners[:, 1])
        middle = np.arctan2(box[1], box[0])
        side = wrap_angle(np.arctan2(corners[:, 1], corners[:, 0]) - middle)
        first_m, top_m = float(corner_m.max()), float(box[2] + box[5] / 2)
        edge_m = max(first_m if top_m < 0 else float(corner_m.min()), 1e-9)
        length_m = MAX_LENGTH_M
        if ground_m < top_m < 0:
            length_m = min(MAX_LENGTH_M, first_m * (ground_m / top_m - 1))
        centre = (side.max() + side.min()) / 2
        return cls(
            first_m,
            max(length_m, 1e-9),
            float(middle + centre),
            max(float(side.max() - side.min()) / 2, 1e-9),
            top_m / edge_m,
        )

    def returns(self, seen: PolarPoints) -> ShadowReturns:
        """Those in it."""
        across = np.abs(wrap_angle(seen.azimuth_rad - self.azimuth_rad)) / self.half_rad
        along = (seen.flat_m - self.first_m) / self.length_m
        is_below = seen.height_m < self.top_slope * seen.flat_m
        inside = np.flatnonzero((across <= 1) & (along >= 0) & (along <= 1) & is_below)
        return ShadowReturns(seen.points[inside], along[inside], across[inside])

    def injected(self, ground_m: float) -> ShadowReturns:
        """As many returns as a spoofer can inject, where they raise the score most: the invalidation attack
        on a real object."""
        along, across, up = evenly(MOST_SPOOFED_POINTS, 3).T
        flat_m = self.first_m + NEAR_PART * along * self.length_m
        azimuth_rad = self.azimuth_rad + MIDDLE_PART * (2 * across - 1) * self.half_rad
        top_m = self.top_slope * flat_m
        low_m = np.maximum(ground_m, top_m - LOW_M) if np.isinf(ground_m) else np.full(len(up), ground_m)
        height_m = low_m + up * np.clip(top_m - low_m, 0.0, LOW_M)
        places = [flat_m * np.cos(azimuth_rad), flat_m * np.sin(azimuth_rad), height_m]
        return self.returns(PolarPoints.of(np.column_stack(places)))
