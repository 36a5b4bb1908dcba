"""A LiDAR of CARLA's: its cloud, and with a semantic LiDAR in the same place the truth about its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import POINT_DTYPE, SEMANTIC_POINT_DTYPE, Cloud
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.sweep import mounting
from advpipe.stages.simulate.world.carla.boxes import entry_m

Float32 = npt.NDArray[np.float32]

RAY_CAST = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
SEMANTIC = np.dtype([*((name, "<f4") for name in ("x", "y", "z", "cosine")), ("id", "<u4"), ("tag", "<u4")])


def check_lidar(place: str, section: LidarSensor) -> None:
    """Raise UsageError for settings that CARLA's LiDAR lacks."""
    if section.vertical_angles_deg is not None:
        raise UsageError(
            f"{place}: CARLA spaces a LiDAR's channels evenly; leave out vertical_angles_deg and preset, and "
            "give channels, upper_fov and lower_fov"
        )
    if section.motion_distortion:
        raise UsageError(
            f"{place}.motion_distortion: all rays of CARLA's LiDAR leave at once; set it to false"
        )
    if section.range_reflectivity > 0:
        raise UsageError(f"{place}.range_reflectivity: CARLA's surfaces have no reflectivity; set it to 0")


class CarlaLidar:
    """How one LiDAR of the scenario is set up in CARLA, and how its data are read.

    Each of CARLA's steps casts a whole turn, whatever the rotation frequency: the rays of a turn leave at the
    cloud's stamp, as without motion distortion in the embedded world.
    """

    def __init__(self, section: LidarSensor, step_s: float) -> None:
        self._section = section
        self._turn_steps = round(1 / (section.rotation_frequency * step_s))
        self.base_SE3_sensor: Float64 = mounting(section)
        sweep = {
            "channels": section.channels,
            "range": section.range,
            "points_per_second": round(section.columns * section.channels / step_s),
            "rotation_frequency": 1 / step_s,
            "upper_fov": section.upper_fov,
            "lower_fov": section.lower_fov,
            "horizontal_fov": 360.0,
            "sensor_tick": 0.0,
        }
        losses = {
            "atmosphere_attenuation_rate": section.atmosphere_attenuation_rate,
            "dropoff_general_rate": section.dropoff_general_rate,
            "dropoff_intensity_limit": section.dropoff_intensity_limit,
            "dropoff_zero_intensity": section.dropoff_zero_intensity,
            "noise_stddev": section.noise_stddev,
        }
        self.attributes = {
            "sensor.lidar.ray_cast": {**sweep, **losses},
            "sensor.lidar.ray_cast_semantic": sweep,
        }

    def is_due(self, frame: int) -> bool:
        """Whether a turn ends at this frame of the drive."""
        return frame % self._turn_steps == 0

    def cloud(self, data: Any, truth: Any, carrier: int) -> tuple[Cloud, npt.NDArray[np.int64]]:
        """The cloud, column by column in a right-handed frame, and the actor that each point is on.

        data, truth: `carla.LidarMeasurement` and `carla.SemanticLidarMeasurement` of the same frame.
        Points on the carrier's own body are left out.
        """
        rows = np.frombuffer(data.raw_data, RAY_CAST)
        channels, columns = self._rays(data, rows)
        actors = self.turn(truth).actors[channels, columns]
        order = np.lexsort((-channels, columns))
        order = order[actors[order] != carrier]
        cloud = np.zeros(len(order), POINT_DTYPE)
        chosen, grid_m = rows[order], np.float32(self._section.coordinate_grid_m)
        for name, sign in (("x", 1), ("y", -1), ("z", 1)):
            cloud[name] = np.float32(sign) * chosen[name]
            if grid_m:
                cloud[name] = np.rint(cloud[name] / grid_m) * grid_m
        cloud["intensity"] = chosen["intensity"]
        cloud["ring"] = self._section.channels - 1 - channels[order]
        return cloud, actors[order]

    @staticmethod
    def semantic(truth: Any) -> Cloud:
        """The points of the semantic LiDAR, right-handed, otherwise as CARLA gives them."""
        points: Cloud = np.frombuffer(truth.raw_data, SEMANTIC).astype(SEMANTIC_POINT_DTYPE)
        points["y"] *= -1
        return points

    def turn(self, truth: Any) -> Turn:
        """What each ray of a turn hits first, from the semantic LiDAR."""
        rows = np.frombuffer(truth.raw_data, SEMANTIC)
        channels, columns = self._rays(truth, rows)
        shape = (self._section.channels, self._section.columns)
        actors, range_m = np.zeros(shape, np.int64), np.full(shape, np.inf, np.float32)
        actors[channels, columns] = rows["id"]
        range_m[channels, columns] = np.sqrt(rows["x"] ** 2 + rows["y"] ** 2 + rows["z"] ** 2)
        return Turn(actors, range_m, np.linspace(self._section.upper_fov, self._section.lower_fov, shape[0]))

    def _rays(self, data: Any, rows: npt.NDArray[np.void]) -> tuple[npt.NDArray[np.int64], ...]:
        """The channel (0 is the highest) and the column (0 is behind, clockwise) of each point."""
        counts = [data.get_point_count(channel) for channel in range(self._section.channels)]
        yaw = np.arctan2(rows["y"].astype(np.float64), rows["x"].astype(np.float64))
        columns = np.rint((yaw + np.pi) / (2 * np.pi) * self._section.columns).astype(np.int64)
        return np.repeat(np.arange(len(counts)), counts), columns % self._section.columns


@dataclass(frozen=True)
class Turn:
    """The first hits of a turn by channel and column: actors, range_m (C, K). elevations_deg: (C,)."""

    actors: npt.NDArray[np.int64]
    range_m: Float32
    elevations_deg: Float64

    def occlusion(self, boxes: Boxes, actors: npt.NDArray[np.int64]) -> Float32:
        """The share (M,) of the rays through each box that hit something else before it.

        boxes: in the LiDAR's frame, of these actors (M,). CARLA does not tell what a ray would hit without
        the occluder, so a ray counts for a box whether or not it would pass the body within.
        """
        found = np.zeros(len(actors), np.float32)
        count = self.range_m.shape[1]
        for index, (box, actor) in enumerate(zip(boxes.geometry, actors, strict=True)):
            columns = _columns_near(box, count)
            azimuth = np.pi - 2 * np.pi * columns / count
            up = np.deg2rad(self.elevations_deg)[:, None]
            axes = np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up)
            enter_m = entry_m(np.zeros(3), np.stack(np.broadcast_arrays(*axes), axis=-1), box)
            through = np.isfinite(enter_m)
            blocked = (self.range_m[:, columns] < enter_m) & (self.actors[:, columns] != actor) & through
            found[index] = blocked.sum() / max(through.sum(), 1)
        return found


def _columns_near(box: Float64, count: int) -> npt.NDArray[np.int64]:
    """The columns whose rays may pass a box, of `count` in a turn."""
    away_m, radius_m = float(np.hypot(*box[:2])), float(np.hypot(*box[3:5])) / 2
    if away_m <= radius_m:
        return np.arange(count)
    half = np.arcsin(radius_m / away_m) / (2 * np.pi) * count
    middle = (np.pi - np.arctan2(box[1], box[0])) / (2 * np.pi) * count
    return np.arange(int(np.floor(middle - half)), int(np.ceil(middle + half)) + 1) % count
