"""The stand-in's radar, as CARLA's: random rays in a cone, with the velocities that it knows of actors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from actor import Actor
from geometry import matrix_of

from advpipe.stages.simulate.world.raycast.world import RaycastWorld

DETECTION = np.dtype([(name, "<f4") for name in ("velocity", "azimuth", "altitude", "depth")])


class Radars:
    """Rays pass the carrier's own body, as those from within a mesh do."""

    def __init__(self, world: RaycastWorld) -> None:
        self._world = world
        self._rng = np.random.default_rng(1)

    def detections(self, sensor: Actor, bodies: Sequence[Actor], step_s: float, sign: int) -> bytes:
        """Velocity (positive: moves away), azimuth (positive: right), altitude and depth of each hit."""
        reach_m = float(sensor.values["range"])
        across, up = (
            math.tan(math.radians(float(sensor.values[f"{axis}_fov"]) / 2))
            for axis in ("horizontal", "vertical")
        )
        count = int(float(sensor.values["points_per_second"]) * step_s)
        radius, angle = self._rng.random(count), self._rng.random(count) * 2 * math.pi
        ahead = np.stack(
            [np.ones(count), across * radius * np.cos(angle), up * radius * np.sin(angle)], axis=1
        )
        length = np.linalg.norm(ahead, axis=1)
        ahead /= length[:, None]
        matrix = matrix_of(sensor.pose)
        directions = ahead @ matrix[:3, :3].T
        rays = np.concatenate([np.broadcast_to(matrix[:3, 3], directions.shape), directions], axis=1)
        rays[:, [1, 4]] *= -1  # into the right-handed world
        others = [body for body in bodies if body is not sensor.parent]
        hits = self._world.cast(rays.astype(np.float32), [body.road_user() for body in others])
        velocities = np.array([*(body.velocity for body in others), np.zeros(3)])
        struck = np.where(hits.objects >= 0, hits.objects, len(others))
        sensor.past = [*sensor.past, sensor.pose[:3].copy()][-2:]
        own_mps = (sensor.past[-1] - sensor.past[0]) / step_s
        rows = np.zeros(count, DETECTION)
        rows["velocity"] = sign * ((velocities[struck] - own_mps) * directions).sum(axis=1)
        rows["azimuth"], rows["altitude"] = np.arctan2(ahead[:, 1], ahead[:, 0]), np.arcsin(ahead[:, 2])
        rows["depth"] = hits.range_m
        return rows[hits.range_m <= reach_m * length].tobytes()
