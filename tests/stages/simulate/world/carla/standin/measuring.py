"""What the stand-in's sensors measure. They look at advpipe's ray-cast world."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import msgpack
import numpy as np
from actor import Actor
from cameras import Cameras
from geometry import geographic, matrix_of
from library import SENSORS
from radars import Radars

from advpipe.pipeline.scenario.models import Scenario
from advpipe.stages.simulate.world.raycast.world import RaycastWorld

ROAD = 1
GRAVITY_MPS2 = 9.81


class Instruments:
    """scenario: of the world. origin_deg: latitude and longitude of the map.

    faults: `flips`, whether latitude grows to the north; `numbers`, which instance images have too many;
    `rates`, the sign of the radar's velocities.
    """

    def __init__(
        self,
        world: RaycastWorld,
        scenario: Scenario,
        origin_deg: tuple[float, float],
        faults: Mapping[str, Any],
    ) -> None:
        self._world, self._origin_deg, self.faults = world, origin_deg, faults
        self._cameras, self._radars = Cameras(world, scenario), Radars(world)
        self._rng = np.random.default_rng(0)

    def measure(self, sensor: Actor, bodies: Sequence[Actor], step_s: float) -> bytes:
        if sensor.blueprint == "sensor.other.gnss":
            return msgpack.packb(geographic(sensor.pose, self._origin_deg, bool(self.faults.get("flips"))))
        if sensor.blueprint == "sensor.other.imu":
            return self._imu(sensor, step_s)
        if sensor.blueprint == "sensor.other.radar":
            return self._radars.detections(sensor, bodies, step_s, self.faults.get("rates", 1))
        if sensor.blueprint.startswith("sensor.camera."):
            return self._cameras.picture(sensor, bodies, self.faults.get("numbers", 0))
        return self._lidar(sensor, bodies, step_s)

    def _imu(self, sensor: Actor, step_s: float) -> bytes:
        """Second differences of the place, and gravity; the parent's turn rate; in the sensor's axes."""
        sensor.past = [*sensor.past, sensor.pose[:3].copy()][-3:]
        first, second, third = sensor.past[0], sensor.past[len(sensor.past) // 2], sensor.past[-1]
        force = np.array([0.0, 0.0, GRAVITY_MPS2])
        if len(sensor.past) == 3:
            force += (third - 2 * second + first) / step_s**2
        into_sensor = matrix_of(sensor.pose)[:3, :3].T
        turn_rate = np.radians(sensor.parent.turn_rate if sensor.parent is not None else np.zeros(3))
        compass = (math.radians(sensor.pose[4]) + math.pi / 2) % (2 * math.pi)
        return msgpack.packb([(into_sensor @ force).tolist(), (into_sensor @ turn_rate).tolist(), compass])

    def _lidar(self, sensor: Actor, bodies: Sequence[Actor], step_s: float) -> bytes:
        """Channel after channel from the highest; each turns clockwise, from behind on the first turn."""
        settings = {name: float(sensor.values[name]) for name in SENSORS[sensor.blueprint]}
        channels, field_deg = int(settings["channels"]), settings["horizontal_fov"]
        columns = round(settings["points_per_second"] * step_s / channels)
        swept_deg = settings["rotation_frequency"] * field_deg * step_s
        yaw = np.radians(swept_deg / columns * np.arange(columns) % field_deg - field_deg / 2)
        pitch = np.radians(np.linspace(settings["upper_fov"], settings["lower_fov"], channels))
        pitch, yaw = (grid.ravel() for grid in np.meshgrid(pitch, yaw, indexing="ij"))
        directions = np.stack(
            [np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)], axis=1
        )
        matrix = matrix_of(sensor.pose)
        rays = np.concatenate(
            [np.broadcast_to(matrix[:3, 3], directions.shape), directions @ matrix[:3, :3].T], axis=1
        )
        rays[:, [1, 4]] *= -1  # into the right-handed world
        hits = self._world.cast(rays.astype(np.float32), [body.road_user() for body in bodies])
        kept = hits.range_m <= settings["range"]
        range_m = np.where(kept, hits.range_m, 0.0).astype(np.float64)
        intensity = np.exp(-settings.get("atmosphere_attenuation_rate", 0.0) * range_m)
        if not sensor.blueprint.endswith("semantic"):
            kept &= self._is_detected(intensity, settings)
        points = (directions * range_m[:, None])[kept].astype("<f4")
        counts = kept.reshape(channels, columns).sum(axis=1).astype("<u4")
        head = struct.pack("<fI", 0.0, channels) + counts.tobytes()
        if not sensor.blueprint.endswith("semantic"):
            return head + np.column_stack([points, intensity[kept].astype("<f4")]).tobytes()
        rows = np.zeros(len(points), [("xyz", "<3f4"), ("cosine", "<f4"), ("id", "<u4"), ("tag", "<u4")])
        struck = hits.objects[kept]
        numbers = np.array([body.id for body in bodies] + [0], np.uint32)
        tags = np.array([body.tag for body in bodies] + [ROAD], np.uint32)
        moving = np.where(struck >= 0, struck, len(bodies))
        rows["xyz"], rows["cosine"] = points, hits.cos_incidence[kept]
        rows["id"], rows["tag"] = numbers[moving], tags[moving]
        return head + rows.tobytes()

    def _is_detected(self, intensity: np.ndarray, settings: dict[str, float]) -> np.ndarray:
        """CARLA's two losses: of any ray, and of weak returns."""
        limit, zero = settings["dropoff_intensity_limit"], settings["dropoff_zero_intensity"]
        kept = self._rng.random(len(intensity)) >= settings["dropoff_general_rate"]
        share = zero / max(limit, 1e-9) * intensity + 1 - zero
        return kept & ((intensity > limit) | (self._rng.random(len(intensity)) < share))
