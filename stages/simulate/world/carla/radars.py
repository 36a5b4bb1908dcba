"""A radar of CARLA's: what its rays hit, with the velocities of actors that CARLA believes to stand still."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw, transform_points
from advpipe.pipeline.sensors.radar.section import RadarSensor

RADAR = "sensor.other.radar"

DETECTION = np.dtype([(name, "<f4") for name in ("velocity", "azimuth", "altitude", "depth")])

AROUND_M = 0.2
"""How far a body may reach out of its box to the sides, as with its mirrors."""

OFF_GROUND_M = 0.05
"""Lower hits in a box are on the road beneath the body."""


def check_radar(place: str, section: RadarSensor) -> None:
    """Raise UsageError for settings that CARLA's radar lacks; a notice tells of those without effect."""
    for key in ("horizontal_fov", "vertical_fov"):
        if getattr(section, key) >= 180:
            raise UsageError(f"{place}.{key}: CARLA's radar sees less than 180 degrees; lower it")
    notice(
        f"{place}: CARLA's radar measures no power, so each return has an RCS of 1 m², and resolution, "
        "detection range, false alarms and multipath have no effect"
    )


class CarlaRadar:
    """How one radar of the scenario is set up in CARLA, and how its measurements are read.

    Each of CARLA's steps is a scan, of as many rays as the time from scan to scan of the scenario has.
    """

    def __init__(self, section: RadarSensor, step_s: float) -> None:
        self._steps, self.range_m = max(round(section.sensor_tick / step_s), 1), section.range
        self.base_SE3_sensor: Float64 = se3_from_yaw(
            [section.x_m, section.y_m, section.z_m], *np.deg2rad([section.yaw_deg, section.pitch_deg])
        )
        self.attributes: Mapping[str, Mapping[str, object]] = {
            RADAR: {
                "horizontal_fov": section.horizontal_fov,
                "vertical_fov": section.vertical_fov,
                "range": section.range,
                "points_per_second": section.points_per_second * self._steps,
                "sensor_tick": 0.0,
            }
        }

    def is_due(self, frame: int) -> bool:
        """Whether there is a scan at this frame of the drive."""
        return frame % self._steps == 0

    def hits(
        self, data: Any, own: Boxes, others: Boxes, map_SE3_base: Float64, radar_mps: Float64 | None
    ) -> Float64:
        """What the radar measured (N, 4): range in metres, azimuth and elevation in radians in its
        right-handed frame, and the rate of range in m/s, positive for what moves away.

        data: a `carla.RadarMeasurement`. own: the carrier's box, on which hits are left out. others: the
        other road users, with what the rate lacks of their velocities. Boxes are in the map frame. radar_mps:
        (3,), the radar's own velocity in its own axes, where the rates are computed from that of a carrier
        which is moved from outside; None where CARLA's rates are right for all that CARLA moves.
        """
        rows = np.frombuffer(data.raw_data, DETECTION)
        range_m, elevation = rows["depth"].astype(np.float64), rows["altitude"].astype(np.float64)
        azimuth = -rows["azimuth"].astype(np.float64)
        level = np.cos(elevation)
        ahead = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)
        map_SE3_radar = map_SE3_base @ self.base_SE3_sensor
        directions = ahead @ map_SE3_radar[:3, :3].T
        points_m = transform_points(map_SE3_radar, ahead * range_m[:, None])
        rate_mps = rows["velocity"].astype(np.float64) if radar_mps is None else -(ahead @ radar_mps)
        lacking_mps = np.zeros_like(points_m)
        bodies = points_in_boxes(points_m, _bodies(others))
        for inside, velocity_mps in zip(bodies, others.velocity_mps, strict=True):
            lacking_mps[inside] = velocity_mps
        rate_mps += (directions * lacking_mps).sum(axis=1)
        hits = np.stack([range_m, azimuth, elevation, rate_mps], axis=1)
        kept = np.ones(len(hits), np.bool_)
        for inside in points_in_boxes(points_m, own.geometry):
            kept[inside] = False
        return hits[kept]


def _bodies(boxes: Boxes) -> Float64:
    """The boxes (M, 7) with room for what sticks out, and without the road beneath."""
    geometry = boxes.geometry.copy()
    geometry[:, 3:5] += 2 * AROUND_M
    geometry[:, 2] += OFF_GROUND_M / 2 + AROUND_M / 2
    geometry[:, 5] += AROUND_M - OFF_GROUND_M
    return geometry
