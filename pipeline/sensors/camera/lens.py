"""Projections of cameras: a pinhole with plumb_bob distortion, and an equidistant fisheye.

Axes are those of an optical frame (REP-103): x right, y down, z forward. Pixel (0, 0) is the centre of the
top left pixel.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]

_ROUNDS = 60
_CLOSE_PX = 1e-3


class LensError(ValueError):
    """A projection that is not invertible over its image."""


@dataclass(frozen=True)
class Lens(ABC):
    """size_px: width and height. matrix: (3, 3) camera matrix K. distortion: as many as `coefficients`.

    distortion_model: its name in sensor_msgs/CameraInfo.
    """

    size_px: tuple[int, int]
    matrix: Float64
    distortion: tuple[float, ...]

    distortion_model: ClassVar[str]
    coefficients: ClassVar[int]

    @abstractmethod
    def project(self, points: Float64) -> Float64:
        """Pixels (N, 2) of points (N, 3) in the optical frame; NaN for those that no pixel shows."""

    @abstractmethod
    def directions(self, pixels: Float64) -> Float64:
        """Unit vectors (N, 3) in the optical frame of pixels (N, 2); NaN for those that see nothing."""

    @abstractmethod
    def check(self) -> None:
        """Raise LensError if the distortion folds back within the image."""

    def _border(self) -> Float64:
        """Normalised coordinates (N, 2) on the border of the image and in its corners."""
        width, height = self.size_px
        x, y = np.linspace(0, width - 1, 33), np.linspace(0, height - 1, 33)
        border = np.concatenate(
            [np.column_stack([x, np.full(33, row)]) for row in (0, height - 1)]
            + [np.column_stack([np.full(33, column), y]) for column in (0, width - 1)]
        )
        return self._normalised(border)

    def _normalised(self, pixels: Float64) -> Float64:
        focal, centre = np.diag(self.matrix)[:2], self.matrix[:2, 2]
        normalised: Float64 = (pixels - centre) / focal
        return normalised

    def _pixels(self, normalised: Float64) -> Float64:
        pixels: Float64 = normalised * np.diag(self.matrix)[:2] + self.matrix[:2, 2]
        return pixels


class Pinhole(Lens):
    """The pinhole with radial and tangential distortion k1, k2, p1, p2, k3 (Brown 1966, as in OpenCV)."""

    distortion_model = "plumb_bob"
    coefficients = 5

    def project(self, points: Float64) -> Float64:
        ahead = points[:, 2] > 1e-9
        plane = np.where(ahead[:, None], points[:, :2] / np.where(ahead, points[:, 2], 1.0)[:, None], np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            beyond = (plane**2).sum(axis=1) > self._reach**2
            plane[beyond] = np.nan  # the polynomial holds within the image only
            return self._pixels(self._distorted(plane))

    def directions(self, pixels: Float64) -> Float64:
        plane = self._undistorted(self._normalised(pixels))
        rays = np.column_stack([plane, np.ones(len(plane))])
        unit: Float64 = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit

    def check(self) -> None:
        if not any(self.distortion):
            return
        border = self._border()
        plane = self._undistorted(border)
        error_px = np.abs((self._distorted(plane) - border) * np.diag(self.matrix)[:2])
        reach = np.linalg.norm(plane, axis=1).max()
        radius = np.linspace(0, reach, 512)
        k1, k2, _, _, k3 = self.distortion
        slope = 1 + 3 * k1 * radius**2 + 5 * k2 * radius**4 + 7 * k3 * radius**6
        if not (np.isfinite(plane).all() and error_px.max() < _CLOSE_PX and slope.min() > 0):
            raise LensError(
                "distortion folds back within the image: several directions meet in one pixel; lower it"
            )

    @cached_property
    def _reach(self) -> float:
        """The greatest undistorted radius that the image shows, with a margin."""
        return 1.05 * float(np.linalg.norm(self._undistorted(self._border()), axis=1).max())

    def _distorted(self, plane: Float64) -> Float64:
        if not any(self.distortion):
            return plane
        k1, k2, p1, p2, k3 = self.distortion
        x, y = plane.T
        square = x * x + y * y
        radial = 1 + square * (k1 + square * (k2 + square * k3))
        return np.column_stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
                y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
            ]
        )

    def _undistorted(self, distorted: Float64) -> Float64:
        """The inverse by Newton's method with the derivatives of the radial part."""
        plane = distorted.copy()
        if not any(self.distortion):
            return plane
        k1, k2, _, _, k3 = self.distortion
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for _ in range(_ROUNDS):
                square = (plane**2).sum(axis=1, keepdims=True)
                slope = 1 + square * (k1 + square * (k2 + square * k3))
                step = (distorted - self._distorted(plane)) / slope
                plane = plane + step
                if np.nanmax(np.abs(step), initial=0.0) < 1e-12:
                    break
        return plane


class Fisheye(Lens):
    """The equidistant fisheye: r = f theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).

    Kannala and Brandt 2006, as OpenCV's fisheye model and the distortion model `equidistant` of ROS have it.
    """

    distortion_model = "equidistant"
    coefficients = 4

    def project(self, points: Float64) -> Float64:
        across = np.hypot(points[:, 0], points[:, 1])
        angle = np.arctan2(across, points[:, 2])
        radius = np.where(angle <= self._largest, self._radius(angle), np.nan)
        share = np.where(across > 1e-12, radius / np.maximum(across, 1e-12), 0.0)
        share[np.isnan(radius)] = np.nan
        return self._pixels(points[:, :2] * share[:, None])

    def directions(self, pixels: Float64) -> Float64:
        plane = self._normalised(pixels)
        radius = np.linalg.norm(plane, axis=1)
        angles = np.linspace(0, self._largest, 8192)
        known = self._radius(angles)
        angle = np.interp(radius, known, angles, right=np.nan)
        for _ in range(3):  # refine what the table gives
            slope = (self._radius(angle + 1e-6) - self._radius(angle - 1e-6)) / 2e-6
            angle = angle + (radius - self._radius(angle)) / slope
        share = np.sin(angle) / np.maximum(radius, 1e-12)
        rays: Float64 = np.column_stack([plane * share[:, None], np.cos(angle)])
        return rays

    def check(self) -> None:
        middle_rad = np.linspace(0, self._largest, 4096)
        if np.diff(self._radius(middle_rad)).min() <= 0 or self._largest <= 0:
            raise LensError(
                "distortion folds back within the field of view: several directions meet in one pixel; "
                "lower it"
            )

    @cached_property
    def _largest(self) -> float:
        """The largest angle to the axis that the image shows, at most half a turn."""
        width = self.size_px[0]
        across = float(max(self.matrix[0, 2] + 0.5, width - 0.5 - self.matrix[0, 2]) / self.matrix[0, 0])
        angles = np.linspace(0, np.pi, 8192)
        radius = self._radius(angles)
        beyond = np.flatnonzero(radius >= across * (1 - 1e-12))
        return (
            float(angles[beyond[0]]) if len(beyond) and not any(self.distortion) else min(across * 1.2, np.pi)
        )

    def _radius(self, angle: Float64) -> Float64:
        k1, k2, k3, k4 = self.distortion
        square = angle * angle
        radius: Float64 = angle * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        return radius


_LENSES: dict[str, type[Lens]] = {"pinhole": Pinhole, "fisheye": Fisheye}


def lens_of(projection: str, size_px: tuple[int, int], matrix: Float64, distortion: Sequence[float]) -> Lens:
    """The lens of a projection of the scenario file; missing coefficients are 0."""
    kind = _LENSES[projection]
    whole = (*distortion, *[0.0] * kind.coefficients)[: kind.coefficients]
    return kind(size_px, matrix, tuple(float(each) for each in whole))
