"""Which returns of a radar belong to which road users, by place and velocity."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes, points_in_boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.radar import RadarReturns, xyz_of_returns
from advpipe.pipeline.sensors.radar.section import RadarSensor

ANGLE_SHARE = 0.15
"""Standard deviation of an angle at the threshold, as a share of the beam: 1 / sqrt(2 SNR)."""

MOVING_MPS = 1.0
"""Faster returns over the ground are of something that moves."""


def returns_of_boxes(
    section: RadarSensor, returns: RadarReturns, boxes: Boxes, margin_m: float = 0.5
) -> list[npt.NDArray[np.int64]]:
    """For each of M boxes in the radar's frame, the indices of the returns at it.

    A box is enlarged by margin_m on every side, and by two standard deviations of a weak return's azimuth.
    The height counts only where the radar measures elevation.
    """
    geometry = boxes.geometry.copy()
    beam = np.deg2rad(section.azimuth_resolution_deg)
    geometry[:, 3:5] += 4 * ANGLE_SHARE * beam * np.hypot(geometry[:, 0], geometry[:, 1])[:, None]
    if section.elevation_resolution_deg:
        beam = np.deg2rad(section.elevation_resolution_deg)
        geometry[:, 5] += 4 * ANGLE_SHARE * beam * np.hypot(geometry[:, 0], geometry[:, 1])
    else:
        geometry[:, 2], geometry[:, 5] = 0.0, 1e3
    return points_in_boxes(xyz_of_returns(returns), geometry, margin_m)


def over_ground_mps(section: RadarSensor, returns: RadarReturns, velocity_mps: Float64) -> Float64:
    """The radial velocity (N,) of returns over the ground; velocity_mps: (3,) of the radar, in its axes.

    What stands still has the opposite of the radar's own velocity along the line of sight, folded like any
    other. The difference is folded too.
    """
    place_m = xyz_of_returns(returns)
    ahead = place_m / np.maximum(np.linalg.norm(place_m, axis=1), 1e-6)[:, None]
    moving = returns["velocity"].astype(np.float64) + ahead @ velocity_mps
    most = section.max_velocity_mps
    return np.asarray((moving + most) % (2 * most) - most)


def in_view(section: RadarSensor, boxes: Boxes) -> npt.NDArray[np.bool_]:
    """Whether the centre of each box (M,) in the radar's frame is in range and in the field of view."""
    x_m, y_m, z_m = boxes.geometry[:, :3].T
    flat_m = np.hypot(x_m, y_m)
    inside = np.abs(np.arctan2(y_m, x_m)) <= np.deg2rad(section.horizontal_fov) / 2
    inside &= np.abs(np.arctan2(z_m, flat_m)) <= np.deg2rad(section.vertical_fov) / 2
    return np.asarray(inside & (np.hypot(flat_m, z_m) <= section.range))
