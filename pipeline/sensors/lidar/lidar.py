"""A rotating LiDAR: the rays of a turn, and the cloud measured from their hits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, xyz
from advpipe.pipeline.sensors.lidar.atmosphere import (
    ASSUMED_REFLECTIVITY,
    Echoes,
    atmosphere_of,
    transmission,
)
from advpipe.pipeline.sensors.lidar.intensity import detected_share, kept_share, noise_floor, return_signal
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.sweep import LidarSweep, mounting
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import Hits

Float32 = npt.NDArray[np.float32]

MIN_RANGE_M = 0.9

CLEAR_MARGIN = np.float32(2.0)
"""For a sensor that detects everything in range, the return of every surface in clear air is at least this
many times the noise floor; bad weather reduces this margin."""

WEAK_NOISE_M = 0.09
"""The range error of a return as strong as the noise is this over sqrt(2) (LISA, Kilic et al. 2021)."""


class Lidar:
    """One sensor in given weather.

    Without motion distortion, all rays of a turn leave at the cloud's stamp, and `time` is 0. With it, the
    rays leave column by column during the turn that ends at the stamp, each from the vehicle's pose at that
    instant. Points are then in the LiDAR's frame at their own instant, as in the output of a driver, and
    `time` is that instant relative to the stamp: negative or 0, as in velodyne's driver. The ground truth is
    valid at the stamp.
    """

    def __init__(
        self, sensor: LidarSensor, step_s: float | None = None, weather: Weather | None = None
    ) -> None:
        self._sensor = sensor
        self._sweep = LidarSweep(sensor)
        self._air = atmosphere_of(weather or Weather(), sensor)
        self._turn_steps = 1 if step_s is None else round(1 / (sensor.rotation_frequency * step_s))
        self._times_s = (
            self._sweep.times_s if sensor.motion_distortion else np.zeros_like(self._sweep.times_s)
        )
        self.base_SE3_lidar: Float64 = mounting(sensor)

    def is_due(self, frame: int) -> bool:
        """Whether a turn ends at this frame."""
        return frame % self._turn_steps == 0

    def rays(self, map_SE3_base: Float64, base_twist: Float64 | None = None) -> Float32:
        """Rays (R, 6) of one turn in the map frame: origin, unit direction; column by column.

        `base_twist` (6,), the vehicle's linear velocity and turn rate in the axes of base_link, is used only
        with motion distortion; it is assumed to be constant over the turn.
        """
        twist = base_twist if self._sensor.motion_distortion else None
        return self._sweep.rays(map_SE3_base, self.base_SE3_lidar, twist)

    def measure(
        self, hits: Hits, rng: np.random.Generator, velocities_mps: npt.ArrayLike | None = None
    ) -> Cloud:
        """The cloud of one turn: intensity in [0, 1], range noise, lost points, and echoes from the air.

        `velocities_mps` (K, 3): of the road users to which `hits.objects` refers, in the LiDAR's axes at the
        stamp; used only with motion distortion. The rays hit road users at their positions at the stamp, and
        each point on one is moved by velocity times time. That is exact for the position of its surface, but
        moves the point off its ray.
        """
        noise = rng.standard_normal(len(hits.range_m), dtype=np.float32)
        uniform = rng.random(len(hits.range_m), dtype=np.float32)
        rays = np.flatnonzero((hits.range_m >= MIN_RANGE_M) & (hits.range_m <= self._sensor.range))
        range_m = hits.range_m[rays]
        clear = return_signal(hits, rays, self._sensor.atmosphere_attenuation_rate)
        signal, share, stddev_m = self._received(clear, range_m)
        share *= kept_share(self._sensor, np.minimum(signal, 1))
        kept = np.flatnonzero(uniform[rays] < share)
        rays, range_m = rays[kept], range_m[kept] + noise[rays[kept]] * stddev_m[kept]
        points = _Points(rays, range_m, signal[kept], hits.objects[rays])
        if self._air is not None:
            points = _with_stronger_echoes(points, self._air.echoes(len(hits.range_m), rng), hits.range_m)
        return self._cloud(points, velocities_mps)

    def undistorted(self, cloud: Cloud, base_twist: Float64) -> npt.NDArray[np.floating[Any]]:
        """Points (N, 3) of a cloud in the LiDAR's frame at its stamp: compensated for the vehicle's motion.

        Points on moving objects remain at their positions at each point's time.
        """
        if not self._sensor.motion_distortion:
            return xyz(cloud)
        return self._sweep.undistorted(xyz(cloud), cloud["time"], self.base_SE3_lidar, base_twist)

    def _received(self, clear: Float32, range_m: Float32) -> tuple[Float32, Float32, Float32]:
        """The received part of the clear-air signal, the share that is detected, and the range error."""
        sensor, air = self._sensor, self._air
        stddev_m = np.full(len(clear), sensor.noise_stddev, np.float32)
        has_reflectivity = sensor.range_reflectivity > 0
        if air is None and not has_reflectivity:
            return clear, np.ones_like(clear), stddev_m
        margin = clear / noise_floor(sensor, range_m, None if has_reflectivity else ASSUMED_REFLECTIVITY)
        if air is None:
            return clear, detected_share(margin), stddev_m
        if not has_reflectivity:
            np.maximum(margin, CLEAR_MARGIN, out=margin)
        transmitted = transmission(air, range_m)
        excess = (1 / np.maximum(transmitted, np.float32(1e-20)) - 1) / margin
        stddev_m = np.sqrt(np.square(stddev_m) + np.float32(WEAK_NOISE_M**2 / 2) * excess)
        return clear * transmitted, detected_share(margin * transmitted), stddev_m

    def _cloud(self, points: _Points, velocities_mps: npt.ArrayLike | None) -> Cloud:
        sweep, grid_m, rays = self._sweep, np.float32(self._sensor.coordinate_grid_m), points.rays
        cloud = np.empty(len(rays), POINT_DTYPE)
        cloud["intensity"] = np.minimum(points.signal, 1)
        cloud["ring"] = sweep.rings[rays]
        time_s = self._times_s[rays]
        cloud["time"] = time_s
        moving = np.flatnonzero(points.objects >= 0)
        if velocities_mps is None or not self._sensor.motion_distortion:
            moving = moving[:0]
        else:
            by_user = np.asarray(velocities_mps, dtype=np.float32).reshape(-1, 3)
            moved_m = by_user[points.objects[moving]] * time_s[moving, None]
        for axis, name in enumerate("xyz"):
            position_m = sweep.directions[axis][rays] * points.range_m
            if len(moving):
                position_m[moving] += moved_m[:, axis]
            if grid_m:
                position_m = np.rint(position_m / grid_m) * grid_m  # exact: the grid is a power of two
            cloud[name] = position_m
        return cloud


class _Points(NamedTuple):
    """N points of one turn: rays (N,) int64 ascending, range_m (N,), signal (N,), objects (N,) as in Hits."""

    rays: npt.NDArray[np.int64]
    range_m: Float32
    signal: Float32
    objects: npt.NDArray[np.int32]


def _with_stronger_echoes(points: _Points, echoes: Echoes, reach_m: Float32) -> _Points:
    """The points, each replaced by a stronger echo of the air: a sensor reports the strongest return.

    reach_m: (R,), the length of air along each of all rays.
    """
    power = np.zeros(len(reach_m), np.float32)
    power[points.rays] = points.signal / np.square(points.range_m)
    stronger = echoes.signal > power[echoes.rays] * np.square(echoes.range_m)
    stronger &= echoes.range_m < reach_m[echoes.rays]
    rays = echoes.rays[stronger]
    air = _Points(rays, echoes.range_m[stronger], echoes.signal[stronger], np.full(len(rays), -1, np.int32))
    # If a ray has both, the echo takes its slot; slots keep the order of the rays without sorting.
    slot = np.full(len(reach_m), -1, np.int64)
    slot[points.rays] = np.arange(len(points.rays))
    slot[air.rays] = len(points.rays) + np.arange(len(air.rays))
    order = slot[slot >= 0]
    return _Points(
        np.concatenate([points.rays, air.rays])[order],
        np.concatenate([points.range_m, air.range_m])[order],
        np.concatenate([points.signal, air.signal])[order],
        np.concatenate([points.objects, air.objects])[order],
    )
