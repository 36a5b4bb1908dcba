"""LiDAR clouds: a numpy structured array, zero-copy to and from sensor_msgs/PointCloud2."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Cloud = npt.NDArray[np.void]

POINT_DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")]
)
"""One point, 22 bytes, as the velodyne driver lays it out: metres, intensity in [0, 1], channel from
the lowest up, seconds after the cloud's stamp."""


def xyz(cloud: Cloud) -> npt.NDArray[np.float32]:
    """Coordinates (N, 3) float32 of a cloud, a copy."""
    return np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=-1)


def xyzi(cloud: Cloud) -> npt.NDArray[np.float32]:
    """Coordinates and intensity (N, 4) float32 of a cloud, a copy: what a detector reads."""
    return np.stack([cloud["x"], cloud["y"], cloud["z"], cloud["intensity"]], axis=-1)
