"""Rotating LiDARs: the rays they send, what they make of what these hit, and the weather between."""

from advpipe.stages.simulate.sensors.lidar.sensor import Lidar

__all__ = ["Lidar"]
