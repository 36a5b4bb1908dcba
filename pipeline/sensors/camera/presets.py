"""Known cameras, by the values of their section that differ from the defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

CAMERA_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "front": {"image_size_x": 640, "image_size_y": 360, "fov": 70.0},
    "kitti": {
        "image_size_x": 1242,
        "image_size_y": 375,
        "intrinsics": {"fx": 721.5377, "fy": 721.5377, "cx": 609.5593, "cy": 172.854},
        "x_m": 0.27,
        "z_m": 1.65,
    },
    "fisheye": {
        "image_size_x": 640,
        "image_size_y": 480,
        "projection": "fisheye",
        "fov": 185.0,
        "x_m": 2.2,
        "z_m": 0.7,
    },
}
"""`front` looks through the windscreen; `kitti` has the projection of most pictures of KITTI's camera 2
(Geiger et al. 2013); `fisheye` is a wide-angle camera in a bumper."""
