"""The matrices of KITTI's calibration files, each refused where it cannot be what it is said to be."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.kitti.number_lines import matrix_of

_RIGID = 1e-3
"""How far R @ R.T may be from the identity: KITTI rounds to seven digits, converters to fewer."""

_SINGULAR = 1e-9
"""The least volume that the rows of an invertible matrix span, as a share of the product of their lengths."""

_WIDEST_DEG = 45.0
"""KITTI's cameras look forward, along the LiDAR's x; other data sets in its form do so roughly."""


class CalibrationFile:
    """The numbers of one file by key. fix: what the user can do about a damaged one.

    Every method raises AdvpipeError, one line with the file, the key and the fix.
    """

    def __init__(self, file: Path, numbers: Mapping[str, Float64], fix: str) -> None:
        self._file, self._numbers, self._fix = file, dict(numbers), fix

    def has(self, key: str) -> bool:
        """Whether the file says this: converters write zeros where they know nothing."""
        values = self._numbers.get(key)
        return values is not None and bool(not values.size or values.any())

    def matrix(self, key: str, shape: tuple[int, ...]) -> Float64:
        """Finite numbers."""
        return matrix_of(self._numbers, key, shape, self._file, self._fix)

    def rotation(self, key: str) -> Float64:
        """A rotation (3, 3)."""
        return self._checked(key, self.matrix(key, (3, 3)))

    def pose(self, key: str) -> Float64:
        """A rotation and a translation (4, 4), written as (3, 4)."""
        matrix = self.matrix(key, (3, 4))
        self._checked(key, matrix[:, :3])
        return np.vstack([matrix, [0.0, 0.0, 0.0, 1.0]])

    def projection(self, key: str) -> Float64:
        """A projection (3, 4), of which the left 3 x 3 is invertible."""
        matrix = self.matrix(key, (3, 4))
        left = matrix[:, :3]
        lengths = float(np.prod(np.linalg.norm(left, axis=1)))
        if not abs(float(np.linalg.det(left))) > _SINGULAR * lengths:
            raise AdvpipeError(
                f"{self._file}: {key} is no projection, its left 3 x 3 cannot be inverted; {self._fix}"
            )
        return matrix

    def projections(self, keys: Mapping[int, str], needed: int) -> dict[int, Float64]:
        """The projections of the cameras, without those of zeros, of which `needed` may be none."""
        return {
            camera: self.projection(key)
            for camera, key in keys.items()
            if camera == needed or self.has(key) or key not in self._numbers
        }

    def refuse_camera_aside(self, key: str, camera_R_lidar: Float64) -> None:
        """Refuse a camera that does not look along the LiDAR's x: the axes are others than KITTI's."""
        along = float(camera_R_lidar[2, 0])
        angle_deg = float(np.degrees(np.arccos(np.clip(along, -1.0, 1.0))))
        if angle_deg > _WIDEST_DEG:
            raise AdvpipeError(
                f"{self._file}: by {key}, the camera looks {angle_deg:.0f}° aside from the LiDAR's x; {key} "
                "takes the LiDAR's axes (x forward, y left, z up) to the camera's (x right, y down, z ahead)"
            )

    def _checked(self, key: str, rotation: Float64) -> Float64:
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=_RIGID) or np.linalg.det(rotation) < 0:
            raise AdvpipeError(f"{self._file}: {key} is no rotation; {self._fix}")
        return rotation
