"""Poses and boxes of CARLA's actors in the map's frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from advpipe.pipeline.geometry.carla import carla_from_se3, se3_from_carla
from advpipe.pipeline.geometry.transforms import Float64, invert, se3
from advpipe.stages.simulate.bodies import Variant


def transform_of(map_SE3_body: Float64) -> Any:
    """The `carla.Transform` of a right-handed pose (4, 4)."""
    import carla

    x_m, y_m, z_m, roll, yaw, pitch = carla_from_se3(map_SE3_body)
    return carla.Transform(carla.Location(x_m, y_m, z_m), carla.Rotation(pitch=pitch, yaw=yaw, roll=roll))


def pose_of(transform: Any) -> Float64:
    """The right-handed pose (4, 4) of a `carla.Transform`."""
    place, turn = transform.location, transform.rotation
    return se3_from_carla([place.x, place.y, place.z, turn.roll, turn.yaw, turn.pitch])


def vector_of(vector: Any) -> Float64:
    """A `carla.Vector3D` of a velocity or place as right-handed (3,)."""
    return np.array([vector.x, -vector.y, vector.z])


@dataclass(frozen=True)
class ActorBox:
    """The box of an actor: its size, and where its ground centre is in the actor's frame.

    actor_SE3_base: (4, 4), base_link below the middle of the box. An actor's own origin is on the ground for
    vehicles and in the middle of the body for pedestrians.
    """

    length_m: float
    width_m: float
    height_m: float
    actor_SE3_base: Float64

    @classmethod
    def of(cls, box: Any) -> ActorBox:
        """The box of a `carla.BoundingBox`."""
        half, middle = box.extent, box.location
        base = se3(np.eye(3), (middle.x, -middle.y, middle.z - half.z))
        return cls(2 * half.x, 2 * half.y, 2 * half.z, base)

    @property
    def sizes_m(self) -> Float64:
        """Length, width and height (3,)."""
        return np.array([self.length_m, self.width_m, self.height_m])

    def sized(self, variant: Variant) -> Variant:
        """The same body in the size of this box."""
        return replace(variant, length_m=self.length_m, width_m=self.width_m, height_m=self.height_m)

    def map_SE3_actor(self, map_SE3_base: Float64) -> Float64:
        """Where the actor is whose box stands at `map_SE3_base`."""
        pose: Float64 = map_SE3_base @ invert(self.actor_SE3_base)
        return pose
