"""A rotating LiDAR: the rays of a turn, and the cloud measured from their hits."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, xyz
from advpipe.pipeline.sensors.lidar.atmosphere import atmosphere_of
from advpipe.pipeline.sensors.lidar.edges import bloom, is_dazzling
from advpipe.pipeline.sensors.lidar.losses import Patches
from advpipe.pipeline.sensors.lidar.own_body import OwnBody, look_at_own_body
from advpipe.pipeline.sensors.lidar.points import Points
from advpipe.pipeline.sensors.lidar.receiver import received
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.sweep import LidarSweep, mounting
from advpipe.pipeline.sensors.lidar.targets import targets_of
from advpipe.pipeline.sensors.weather import Weather
from advpipe.pipeline.sensors.world import CarrierSurroundings, Hits

Float32 = npt.NDArray[np.float32]


class Lidar:
    """One sensor in given weather.

    Without motion distortion, all rays of a turn leave at the cloud's stamp, and `time` is 0. With it, the
    rays leave column by column during the turn that ends at the stamp, each from the vehicle's pose at that
    instant. Points are then in the LiDAR's frame at their own instant, as in the output of a driver, and
    `time` is that instant relative to the stamp: negative or 0, as in velodyne's driver. The ground truth is
    valid at the stamp.
    """

    def __init__(
        self,
        sensor: LidarSensor,
        step_s: float | None = None,
        weather: Weather | None = None,
        calibration: np.random.Generator | None = None,
    ) -> None:
        """calibration: draws the fixed errors of the rings; without it they are perfect."""
        self._sensor, self._real = sensor, sensor.imperfections
        elevation_error_rad = None
        ring_error_m: Float32 = np.zeros(sensor.channels, np.float32)
        if calibration is not None:
            draws = calibration.standard_normal((2, sensor.channels))
            elevation_error_rad = draws[0] * np.deg2rad(self._real.ring_elevation_stddev_deg)
            ring_error_m = (draws[1] * self._real.ring_range_stddev_m).astype(np.float32)
        self._sweep = LidarSweep(sensor, elevation_error_rad)
        self._ray_error_m: Float32 = ring_error_m[self._sweep.rings]
        weather = weather or Weather()
        self._air = atmosphere_of(weather, sensor)
        self._wetness = min(weather.rate_mm_per_h, 1.0) if weather.kind == "rain" else 0.0
        self._patches = (
            Patches(self._sweep.columns, self._sweep.channels) if self._real.patchy_losses else None
        )
        self._own: OwnBody | None = None
        self._turn_steps = 1 if step_s is None else round(1 / (sensor.rotation_frequency * step_s))
        self._times_s = (
            self._sweep.times_s if sensor.motion_distortion else np.zeros_like(self._sweep.times_s)
        )
        self.base_SE3_lidar: Float64 = mounting(sensor)

    def mount_on(self, world: CarrierSurroundings) -> None:
        """Let the body of the vehicle in this world shade the rays and return light."""
        if self._real.own_body:
            rays = self._sweep.rays(np.eye(4), self.base_SE3_lidar, None)
            self._own = look_at_own_body(world, rays, self.base_SE3_lidar)

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
        if self._patches is None:
            uniform = rng.random(len(hits.range_m), dtype=np.float32)
        else:
            uniform = self._patches.uniform(rng)
        targets = targets_of(hits, self._sensor, self._sweep, self._own, self._wetness, rng)
        light = received(self._sensor, self._air, targets)
        kept = np.flatnonzero(uniform[targets.rays] < light.share)
        rays = targets.rays[kept]
        range_m = targets.range_m[kept] - targets.relief_m[kept] + noise[rays] * light.stddev_m[kept]
        range_m += self._ray_error_m[rays]
        points = Points(rays, range_m, light.signal[kept], targets.objects[kept])
        if self._real.blooming_deg:
            points = self._with_blooming(points, len(hits.range_m))
        if self._air is not None:
            echoes = self._air.echoes(len(hits.range_m), rng)
            of_air = Points(*echoes, np.full(len(echoes.rays), -1, np.int32))
            points = points.with_stronger(of_air, targets.all_m)
        return self._cloud(points, velocities_mps)

    def _with_blooming(self, points: Points, rays: int) -> Points:
        """The points, and the light of retroreflectors in the rays beside theirs."""
        dazzling = np.flatnonzero(is_dazzling(points.signal))
        if not len(dazzling):
            return points
        sweep, angle_rad = self._sweep, float(np.deg2rad(self._real.blooming_deg))
        found = bloom(points.rays[dazzling], points.signal[dazzling], sweep, angle_rad)
        source = np.searchsorted(points.rays, found.sources)
        beside = Points(found.rays, points.range_m[source], found.signal, points.objects[source])
        return points.with_stronger(beside, np.full(rays, np.inf, np.float32))

    def undistorted(self, cloud: Cloud, base_twist: Float64) -> npt.NDArray[np.floating[Any]]:
        """Points (N, 3) of a cloud in the LiDAR's frame at its stamp: compensated for the vehicle's motion.

        Points on moving objects remain at their positions at each point's time.
        """
        if not self._sensor.motion_distortion:
            return xyz(cloud)
        return self._sweep.undistorted(xyz(cloud), cloud["time"], self.base_SE3_lidar, base_twist)

    def _cloud(self, points: Points, velocities_mps: npt.ArrayLike | None) -> Cloud:
        sweep, grid_m, rays = self._sweep, np.float32(self._sensor.coordinate_grid_m), points.rays
        cloud = np.empty(len(rays), POINT_DTYPE)
        cloud["intensity"] = self._sensor.intensity_response.intensity(points.signal, points.range_m)
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
