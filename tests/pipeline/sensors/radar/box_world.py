"""A world of boxes on a plane, and of walls: what rays hit is worked out here, without a ray caster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64, se3_from_yaw
from advpipe.pipeline.localisation.motion import MotionStep
from advpipe.pipeline.sensors.sensor import Instant
from advpipe.pipeline.sensors.world import SURFACES, Hits


@dataclass(frozen=True)
class SurfaceHits(Hits):
    surface: np.ndarray

    @property
    def surfaces(self) -> np.ndarray:
        return self.surface


@dataclass(frozen=True)
class BoxWorld:
    """rail_y_m: a guard rail along x, 1 m high; None for none."""

    boxes: Boxes
    rail_y_m: float | None = None

    def road_users(self, range_m: float) -> Boxes:
        return self.boxes

    def cast(self, rays: np.ndarray, range_m: float) -> Hits:
        start_m, ahead = rays[:, :3].astype(float), rays[:, 3:].astype(float)
        to_m = [np.where(ahead[:, 2] < 0, -start_m[:, 2] / np.minimum(ahead[:, 2], -1e-9), np.inf)]
        to_m.append(self._to_rail_m(start_m, ahead))
        to_m += [_to_box_m(box, start_m, ahead) for box in self.boxes.geometry]
        nearest = np.stack(to_m)
        first = nearest.argmin(axis=0)
        alone = np.isfinite(nearest[2:]).sum(axis=1)
        seen = np.array([(first == 2 + k).sum() for k in range(len(self.boxes))])
        surface = np.where(first == 1, SURFACES.index("barrier"), SURFACES.index("road"))
        found = nearest.min(axis=0)
        return SurfaceHits(
            found.astype(np.float32),
            np.ones(len(rays), np.float32),
            np.full(len(rays), 0.3, np.float32),
            np.zeros(len(rays), bool),
            np.ones(len(rays), np.float32),
            np.where(np.isfinite(found), first - 2, -1).clip(-1).astype(np.int32),
            (1 - seen / np.maximum(alone, 1)).astype(np.float32) * (alone > 0),
            surface.astype(np.uint8),
        )

    def _to_rail_m(self, start_m: Float64, ahead: Float64) -> Float64:
        if self.rail_y_m is None:
            return np.full(len(ahead), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            away_m = (self.rail_y_m - start_m[:, 1]) / ahead[:, 1]
        height_m = start_m[:, 2] + away_m * ahead[:, 2]
        return np.where((away_m > 0) & (height_m > 0) & (height_m < 1), away_m, np.inf)


def _to_box_m(box: Float64, start_m: Float64, ahead: Float64) -> Float64:
    turned = se3_from_yaw(box[:3], box[6])
    local, way = (start_m - box[:3]) @ turned[:3, :3], ahead @ turned[:3, :3]
    with np.errstate(divide="ignore", invalid="ignore"):
        faces = np.sort([(-box[3:6] / 2 - local) / way, (box[3:6] / 2 - local) / way], axis=0)
    enter, leave = faces[0].max(axis=1), faces[1].min(axis=1)
    return np.where((enter > 0) & (enter < leave), enter, np.inf)


def cars(
    places_m: Sequence[tuple[float, float]], speed_mps: float = 0.0, yaws_rad: Sequence[float] | None = None
) -> Boxes:
    """Cars on the plane, which drive in the direction of their yaw."""
    count = len(places_m)
    yaw = np.zeros(count) if yaws_rad is None else np.array(yaws_rad, float)
    geometry = np.array([[x, y, 0.75, 4.5, 1.8, 1.5, 0.0] for x, y in places_m], float).reshape(-1, 7)
    geometry[:, 6] = yaw
    velocity = speed_mps * np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    names = tuple(f"car{index}" for index in range(count))
    return Boxes(geometry, np.zeros(count, np.int64), names, velocity)


def instant(
    world: BoxWorld, frame: int = 0, velocity_mps: float = 0.0, turn_rate_radps: float = 0.0
) -> Instant:
    """The radar's vehicle at the origin, which heads along x."""
    motion = MotionStep(
        np.eye(4), np.array([velocity_mps, 0, 0]), np.array([0, 0, turn_rate_radps]), np.zeros((0, 3))
    )
    return Instant(frame, frame * 100_000_000, motion, world)
