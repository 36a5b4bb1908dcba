"""One actor of the stand-in, and how it moves by itself."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
from geometry import matrix_of, mirrored
from library import SENSOR_TYPES, TAGS, Library

from advpipe.pipeline.geometry.transforms import se3
from advpipe.stages.simulate.traffic.road_users import RoadUser

GREEN = 2
TORQUE = 6.0
"""Acceleration at full throttle in m/s², without any drag."""


class Actor:
    """description: number, blueprint, attributes, as the client sent it. pose: x, y, z, pitch, yaw, roll.

    A vehicle's origin is on the ground, a pedestrian's in the middle of the body.
    """

    def __init__(self, number: int, description: list[Any], pose: Any, library: Library) -> None:
        self.id, self.description = number, description
        self.blueprint = str(description[1])
        self.values = {name: value for name, _, value in description[2]}
        self.pose = np.array(pose, np.float64)
        self.parent: Actor | None = None
        self.mount = np.eye(4)
        self.velocity, self.turn_rate, self.acceleration = np.zeros(3), np.zeros(3), np.zeros(3)
        self.has_physics, self.lights, self.frozen, self.signal = True, 0, False, 0
        self.control: list[Any] = [0.0, 0.0, 0.0, False, False, False, 0]
        self.walk: list[Any] = [[1.0, 0.0, 0.0], 0.0, False]
        self.past: list[np.ndarray] = []
        self.variant = library.variants.get(self.blueprint)
        self.base_type = library.base_types.get(self.blueprint, "")
        self.sensor_type = SENSOR_TYPES.get(self.blueprint, -1)

    @property
    def is_walker(self) -> bool:
        return self.blueprint.startswith("walker.")

    @property
    def extent(self) -> list[float]:
        """Half of the box's length, width and height; zero for an actor without a body."""
        if self.variant is None:
            return [0.0, 0.0, 0.0]
        return [self.variant.length_m / 2, self.variant.width_m / 2, self.variant.height_m / 2]

    @property
    def box_z_m(self) -> float:
        """The middle of the box above the origin."""
        return 0.0 if self.is_walker else self.extent[2]

    @property
    def tag(self) -> int:
        return TAGS.get(self.base_type, 0)

    @property
    def name(self) -> str:
        """That of the road user that it mirrors, on which colours depend; else its number."""
        role = self.values.get("role_name", "")
        return role.removeprefix("advpipe ") if role.startswith("advpipe ") else str(self.id)

    def road_user(self, name: str = "") -> RoadUser:
        """The body at its place, right-handed, its origin on the ground."""
        assert self.variant is not None
        below = se3(np.eye(3), [0.0, 0.0, self.box_z_m - self.extent[2]])
        pose = mirrored(matrix_of(self.pose)) @ below
        return RoadUser(name or str(self.id), self.variant, pose, np.zeros(3))

    def move(self, step_s: float) -> None:
        """One step: what has no physics stays where it was put, and reports no velocity, as in CARLA."""
        before = self.velocity
        if not self.has_physics or self.variant is None:
            self.velocity, self.turn_rate = np.zeros(3), np.zeros(3)
        elif self.is_walker:
            self.velocity = np.array(self.walk[0]) * self.walk[1]
        else:
            self._drive(step_s)
        self.pose[:3] += self.velocity * step_s
        self.acceleration = (self.velocity - before) / step_s

    def follow(self, pose: np.ndarray) -> None:
        """Be where the parent carries it."""
        assert self.parent is not None
        self.pose, self.velocity = pose, self.parent.velocity

    def own_state(self) -> bytes:
        """What its type adds to a snapshot."""
        if self.blueprint.startswith("vehicle."):
            return struct.pack("<3f3?ifB?IB", *self.control, 50.0, GREEN, False, 0, 0)
        if self.is_walker:
            return struct.pack("<4f?", *self.walk[0], self.walk[1], self.walk[2])
        if self.blueprint == "traffic.traffic_light":
            sign = self.values["sign_id"].encode()
            return struct.pack("<32s4fI?B", sign, 10.0, 3.0, 2.0, 0.0, 0, self.frozen, self.signal)
        return b""

    def _drive(self, step_s: float) -> None:
        """A kinematic bicycle without slip or drag."""
        forward = matrix_of(self.pose)[:3, 0]
        throttle, steer, brake, hand_brake, reverse = self.control[:5]
        speed = float(self.velocity @ forward)
        speed += TORQUE * throttle * step_s * (-1 if reverse else 1)
        speed -= math.copysign(min(abs(speed), 8.0 * max(brake, float(hand_brake)) * step_s), speed)
        turn = speed * math.tan(math.radians(70.0 * steer)) / (1.2 * self.extent[0])
        self.pose[4] = (self.pose[4] + math.degrees(turn * step_s) + 180.0) % 360.0 - 180.0
        self.velocity = speed * matrix_of(self.pose)[:3, 0]
        self.turn_rate = np.array([0.0, 0.0, math.degrees(turn)])
