"""A rotating LiDAR: which rays it sends, and what it makes of what they hit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.cloud import POINT_DTYPE, Cloud
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.scenario.sensors import LidarSensor
from advpipe.stages.simulate.world.materials import REFLECTIVITY
from advpipe.stages.simulate.world.world import Hits

MIN_RANGE_M = 0.9
GRAZING_SHARE = 0.3
"""Share of the intensity that does not fall with the angle of incidence."""


class Lidar:
    """One sensor; all rays of a turn leave at the cloud's stamp."""

    def __init__(self, sensor: LidarSensor) -> None:
        self._sensor = sensor
        elevation = np.deg2rad(np.linspace(sensor.lower_fov, sensor.upper_fov, sensor.channels))
        azimuth = -2 * np.pi * np.arange(sensor.columns) / sensor.columns  # turns clockwise, as most do
        directions = np.stack(
            [
                np.cos(azimuth)[:, None] * np.cos(elevation),
                np.sin(azimuth)[:, None] * np.cos(elevation),
                np.broadcast_to(np.sin(elevation), (sensor.columns, sensor.channels)),
            ],
            axis=-1,
        )
        self.directions: npt.NDArray[np.float32] = directions.reshape(-1, 3).astype(np.float32)
        self._rings = np.tile(np.arange(sensor.channels, dtype=np.uint16), sensor.columns)
        self.base_SE3_lidar: Float64 = se3(np.eye(3), (sensor.x_m, 0.0, sensor.z_m))

    def rays(self, map_SE3_base: Float64) -> npt.NDArray[np.float32]:
        """Rays (R, 6) of one turn in the map's frame: origin, unit direction; column by column."""
        map_SE3_lidar = map_SE3_base @ self.base_SE3_lidar
        rays = np.empty((len(self.directions), 6), np.float32)
        rays[:, :3] = map_SE3_lidar[:3, 3]
        rays[:, 3:] = self.directions @ map_SE3_lidar[:3, :3].T.astype(np.float32)
        return rays

    def measure(self, hits: Hits, rng: np.random.Generator) -> Cloud:
        """The cloud in the LiDAR's frame: intensity, range noise and lost points.

        Intensity is the material's reflectivity, weakened by incidence and by exp(-a d) on the way.
        Loss follows CARLA's `dropoff_*`: a share at random, and of the weak returns a share that
        falls linearly from `dropoff_zero_intensity` to nothing at `dropoff_intensity_limit`.
        """
        sensor = self._sensor
        noise_m = rng.standard_normal(len(hits.range_m), dtype=np.float32) * np.float32(sensor.noise_stddev)
        chance = rng.random((2, len(hits.range_m)), dtype=np.float32)
        seen = np.flatnonzero((hits.range_m >= MIN_RANGE_M) & (hits.range_m <= sensor.range))
        range_m = hits.range_m[seen]
        angle = GRAZING_SHARE + (1 - GRAZING_SHARE) * hits.cos_incidence[seen]
        intensity = REFLECTIVITY[hits.materials[seen]] * angle
        intensity *= np.exp(-sensor.atmosphere_attenuation_rate * range_m)
        kept = chance[0, seen] >= sensor.dropoff_general_rate
        if sensor.dropoff_intensity_limit > 0:
            weakness = np.clip(1 - intensity / sensor.dropoff_intensity_limit, 0, 1)
            kept &= chance[1, seen] >= sensor.dropoff_zero_intensity * weakness
        seen, intensity = seen[kept], intensity[kept]
        points = self.directions[seen] * (range_m[kept] + noise_m[seen])[:, None]
        cloud = np.zeros(len(seen), POINT_DTYPE)
        cloud["x"], cloud["y"], cloud["z"] = points.T
        cloud["intensity"] = intensity
        cloud["ring"] = self._rings[seen]
        return cloud
