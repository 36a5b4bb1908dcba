"""A line of KITTI's label files, and its box in the LiDAR's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.geometry.transforms import Float64, transform_points, wrap_angle
from advpipe.pipeline.kitti.calibration import KittiCalibration

DONT_CARE = "DontCare"
"""The class of parts of an image in which objects are not labelled."""

_COLUMNS = 15
_FIX = "restore the file, or leave out the frame by a split"
_NO_BOX = (-1.0, -1.0, -1.0, -1000.0, -1000.0, -1000.0, -10.0)


@dataclass(frozen=True)
class ObjectLabel:
    """One object, with the fifteen values of KITTI's object benchmark.

    truncation: share outside the image. occlusion: 0 visible, 1 partly, 2 largely occluded, 3 unknown.
    alpha_rad: observation angle. edges_px: left, top, right, bottom in the image of camera 2. size_m: height,
    width, length. bottom_m: centre of the bottom face (3,), and rotation_y_rad about the y axis, in the
    rectified frame of camera 0. Without a 3D box the sizes are not positive.
    """

    class_name: str
    truncation: float
    occlusion: int
    alpha_rad: float
    edges_px: tuple[float, float, float, float]
    size_m: tuple[float, float, float] = (_NO_BOX[0], _NO_BOX[1], _NO_BOX[2])
    bottom_m: tuple[float, float, float] = (_NO_BOX[3], _NO_BOX[4], _NO_BOX[5])
    rotation_y_rad: float = _NO_BOX[6]

    @property
    def has_box(self) -> bool:
        """Whether there is a 3D box."""
        return min(self.size_m) > 0

    def lidar_box(self, calibration: KittiCalibration) -> Float64:
        """The box (7,) in the LiDAR's frame, upright there, as OpenPCDet converts it."""
        height_m, width_m, length_m = self.size_m
        x_m, y_m, z_m = transform_points(calibration.lidar_SE3_rectified, self.bottom_m)
        yaw_rad = float(wrap_angle(-self.rotation_y_rad - math.pi / 2))
        return np.array([x_m, y_m, z_m + height_m / 2, length_m, width_m, height_m, yaw_rad])

    def __str__(self) -> str:
        """The line, with the two decimals that KITTI's labels have."""
        values = (*self.edges_px, *self.size_m, *self.bottom_m)
        if not self.has_box:
            numbers = [*map(_two_decimals, self.edges_px), *(f"{value:g}" for value in _NO_BOX)]
        else:
            numbers = [*map(_two_decimals, values), _two_decimals(self.rotation_y_rad)]
        truncation = "-1" if self.truncation < 0 else _two_decimals(self.truncation)
        alpha = _two_decimals(self.alpha_rad) if self.alpha_rad > -10 else "-10"
        return " ".join([self.class_name, truncation, str(self.occlusion), alpha, *numbers])


def camera_box(
    box: Float64, calibration: KittiCalibration
) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Size, bottom and rotation_y of `ObjectLabel` for a box (7,) in the LiDAR's frame."""
    x_m, y_m, z_m, length_m, width_m, height_m, yaw_rad = map(float, box)
    bottom = transform_points(calibration.rectified_SE3_lidar, (x_m, y_m, z_m - height_m / 2))
    rotation_y_rad = float(wrap_angle(-yaw_rad - math.pi / 2))
    return (
        (height_m, width_m, length_m),
        (float(bottom[0]), float(bottom[1]), float(bottom[2])),
        rotation_y_rad,
    )


def observation_angle(bottom_m: tuple[float, float, float], rotation_y_rad: float) -> float:
    """The angle alpha at which the camera sees an object: its rotation less its direction, in [-pi, pi)."""
    return float(wrap_angle(rotation_y_rad - math.atan2(bottom_m[0], bottom_m[2])))


def read_object_labels(file: Path) -> list[ObjectLabel]:
    """Read label_2/NNNNNN.txt; a sixteenth value, a detection's score, is ignored. Raises AdvpipeError."""
    lines = read_text(file).splitlines()
    return [_label(line, f"{file}: line {number}") for number, line in enumerate(lines, 1) if line.strip()]


def _label(line: str, where: str) -> ObjectLabel:
    class_name, *texts = line.split()
    if len(texts) not in (_COLUMNS - 1, _COLUMNS):
        raise AdvpipeError(f"{where} has {len(texts) + 1} values, not {_COLUMNS}; {_FIX}")
    try:
        values = [float(text) for text in texts]
    except ValueError as error:
        raise AdvpipeError(one_line(f"{where} has a value that is no number ({error}); {_FIX}")) from None
    if not all(map(math.isfinite, values)) or not -128 <= values[1] <= 127:
        raise AdvpipeError(one_line(f"{where} has a value out of its range: {line[:80]!r}; {_FIX}"))
    truncation, occlusion, alpha, left, top, right, bottom, height, width, length, x, y, z, rotation = values[
        :14
    ]
    return ObjectLabel(
        class_name,
        truncation,
        int(occlusion),
        alpha,
        (left, top, right, bottom),
        (height, width, length),
        (x, y, z),
        rotation,
    )


def _two_decimals(value: float) -> str:
    text = f"{value:.2f}"
    return "0.00" if text == "-0.00" else text
