"""The sensors of an Argoverse 2 log: where they are mounted, and the lenses of its cameras."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import Float64, rotations_from_quaternions
from advpipe.stages.import_.av2.feather import POSE, Columns, read_feather
from advpipe.stages.import_.drive import CameraView

LIDARS = ("up_lidar", "down_lidar")


def poses_of(columns: Columns, file: Path) -> Float64:
    """The transforms (K, 4, 4) in the columns `POSE`. Raises AdvpipeError for what is no rotation."""
    found = np.tile(np.eye(4), (len(columns["qw"]), 1, 1))
    try:
        if len(found):
            xyzw = np.stack([columns[name] for name in ("qx", "qy", "qz", "qw")], axis=1)
            found[:, :3, :3] = rotations_from_quaternions(xyzw)
    except ValueError:
        raise AdvpipeError(f"{file}: a rotation is no quaternion") from None
    found[:, :3, 3] = np.stack([columns[name] for name in ("tx_m", "ty_m", "tz_m")], axis=1)
    return found


def read_mounts(log: Path) -> Mapping[str, Float64]:
    """ego_SE3_sensor of each sensor. Raises UsageError if a LiDAR has none."""
    file = log / "calibration" / "egovehicle_SE3_sensor.feather"
    if not file.is_file():
        raise UsageError(f"{file} is missing; complete the download of the log's calibration")
    columns = read_feather(file, ("sensor_name", *POSE))
    found = dict(zip(columns["sensor_name"].tolist(), poses_of(columns, file), strict=True))
    missing = [name for name in LIDARS if name not in found]
    if missing:
        raise UsageError(f"{file} has no pose of {', '.join(missing)}")
    return found


def read_lenses(log: Path) -> Mapping[str, CameraView]:
    """The calibration of each camera; none where the log has no `intrinsics.feather`."""
    file = log / "calibration" / "intrinsics.feather"
    if not file.is_file():
        return {}
    names = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "height_px", "width_px")
    columns = read_feather(file, ("sensor_name", *names))
    views = {}
    for row, name in enumerate(columns["sensor_name"].tolist()):
        fx, fy, cx, cy, k1, k2, k3, height, width = (float(columns[each][row]) for each in names)
        matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        projection = np.hstack([matrix, np.zeros((3, 1))])
        views[name] = CameraView(
            int(width), int(height), matrix, projection, distortion=(k1, k2, 0.0, 0.0, k3)
        )
    return views
