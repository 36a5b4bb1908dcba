"""The rays of one scan: some at each road user, and a grid over the field of view for all else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.radar.section import RadarSensor

_KRONECKER = 1.2207440846057596 ** -np.arange(1, 4)
"""Steps of a sequence that fills a cube evenly (Roberts 2018: R3)."""

INSIDE = 0.96
"""Share of a box's sides that the sampling points fill: bodies are rounded."""

WHEEL_PLACES = np.array([[x, y] for x in (-0.29, 0.29) for y in (-0.46, 0.46)])
"""Wheels of a vehicle, as shares of its length and width from its centre."""

WHEEL_M = 0.33
"""Radius of a wheel."""

_HAS_WHEELS = np.array([name != "pedestrian" for name in CLASSES])


@dataclass(frozen=True)
class Aim:
    """R rays from the radar. directions: (R, 3), unit vectors in its frame. users: (R,), index of the road
    user at which a ray is aimed, -1 for the grid. is_wheel: (R,). grid: rows and columns of the rays of the
    grid, which come first, row by row. ray_solid_angle_sr: of each of these. shares: (M,), of the points
    that sample each road user the share in the field of view."""

    directions: Float64
    users: npt.NDArray[np.int64]
    is_wheel: npt.NDArray[np.bool_]
    grid: tuple[int, int]
    ray_solid_angle_sr: float
    shares: Float64


class Aiming:
    """Draws the rays of a radar."""

    def __init__(self, section: RadarSensor, period_s: float) -> None:
        self._section = section
        self._width_rad, self._height_rad = np.deg2rad([section.horizontal_fov, section.vertical_fov])
        count = max(round(section.points_per_second * period_s), 1)
        columns = int(np.clip(round((count * self._width_rad / self._height_rad) ** 0.5), 1, count))
        self._grid = max(count // columns, 1), columns
        self._sines = 2 * float(np.sin(self._height_rad / 2))
        self._unit = np.arange(1, section.scatterers + 1)[:, None] * _KRONECKER

    def draw(self, boxes: Boxes, rng: np.random.Generator) -> Aim:
        """The rays at the grid and at boxes in the radar's frame; the grid's are random in their cells."""
        rows, columns = self._grid
        jitter = rng.random((2, rows, columns))
        azimuth = ((np.arange(columns) + jitter[0]) / columns - 0.5) * self._width_rad
        sine = ((np.arange(rows)[:, None] + jitter[1]) / rows - 0.5) * self._sines
        level = np.sqrt(1 - sine * sine)
        grid = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), sine], axis=-1).reshape(-1, 3)
        targets, users, is_wheel = self._points(boxes, rng)
        range_m = np.linalg.norm(targets, axis=1)
        flat_m = np.hypot(targets[:, 0], targets[:, 1])
        inside = np.abs(np.arctan2(targets[:, 1], targets[:, 0])) <= self._width_rad / 2
        inside &= np.abs(np.arctan2(targets[:, 2], flat_m)) <= self._height_rad / 2
        inside &= (range_m <= self._section.range + 20) & (range_m > 0.05)
        count = np.bincount(users[inside & ~is_wheel], minlength=len(boxes))
        ahead = targets[inside] / range_m[inside, None]
        none = np.full(len(grid), -1)
        return Aim(
            np.concatenate([grid, ahead]),
            np.concatenate([none, users[inside]]),
            np.concatenate([none >= 0, is_wheel[inside]]),
            self._grid,
            float(self._width_rad * self._sines / (rows * columns)),
            count / len(self._unit),
        )

    def _points(
        self, boxes: Boxes, rng: np.random.Generator
    ) -> tuple[Float64, npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        """Points (N, 3) in the boxes, the box of each, and whether it is on a wheel."""
        sides, near = boxes.geometry[:, None, 3:6], self._may_be_seen(boxes)
        unit = (self._unit + rng.random((len(near), 1, 3))) % 1
        local = ((unit - 0.5) * INSIDE * sides[near]).reshape(-1, 3)
        users = np.repeat(near, len(self._unit))
        is_wheel = np.zeros(len(users), bool)
        if self._section.wheels:
            vehicles = near[_HAS_WHEELS[boxes.labels[near]]]
            low_m = np.broadcast_to(WHEEL_M - sides[vehicles, :, 2:] / 2, (len(vehicles), 4, 1))
            wheels = np.concatenate([WHEEL_PLACES * sides[vehicles, :, :2], low_m], axis=-1)
            local = np.concatenate([local, wheels.reshape(-1, 3)])
            users = np.concatenate([users, np.repeat(vehicles, 4)])
            is_wheel = np.concatenate([is_wheel, np.ones(4 * len(vehicles), bool)])
        yaw = boxes.geometry[users, 6]
        cos, sin = np.cos(yaw), np.sin(yaw)
        points = boxes.geometry[users, :3].copy()
        points[:, 0] += cos * local[:, 0] - sin * local[:, 1]
        points[:, 1] += sin * local[:, 0] + cos * local[:, 1]
        points[:, 2] += local[:, 2]
        return points, users, is_wheel

    def _may_be_seen(self, boxes: Boxes) -> npt.NDArray[np.int64]:
        """Indices of the boxes whose circles reach into the field of view and the range."""
        x_m, y_m = boxes.geometry[:, 0], boxes.geometry[:, 1]
        away_m, radius_m = np.hypot(x_m, y_m), np.hypot(*boxes.geometry[:, 3:5].T) / 2
        margin = np.where(
            away_m > radius_m, np.arcsin(np.minimum(radius_m / np.maximum(away_m, 1e-3), 1)), np.pi
        )
        inside = np.abs(np.arctan2(y_m, x_m)) <= self._width_rad / 2 + margin
        return np.flatnonzero(inside & (away_m <= self._section.range + radius_m))
