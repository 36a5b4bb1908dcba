"""The sensor types by their key in the scenario's section `sensors`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from advpipe.pipeline.sensors.camera.cameras import Cameras
from advpipe.pipeline.sensors.lidar.lidars import Lidars
from advpipe.pipeline.sensors.onboard import Gnss, Imu, WheelOdometry
from advpipe.pipeline.sensors.radar.radars import Radars
from advpipe.pipeline.sensors.sensor import Sensor

SENSORS: Mapping[str, type[Sensor[Any]]] = {
    "lidars": Lidars,
    "radars": Radars,
    "cameras": Cameras,
    "gnss": Gnss,
    "imu": Imu,
    "wheel_odometry": WheelOdometry,
}
"""Sorted in the order of the scenario file and of recording."""
