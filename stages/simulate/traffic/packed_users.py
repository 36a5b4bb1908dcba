"""Road users as arrays, which are pickled fast, for another process."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.codec.codes import ExteriorLights
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.traffic.road_users import RoadUser


class PackedUsers(NamedTuple):
    """N road users of one step.

    poses: (N, 4, 4). velocities_mps: (N, 3). variants: of those that the packer has not packed before.
    """

    names: tuple[str, ...]
    poses: Float64
    velocities_mps: Float64
    lights: tuple[int, ...]
    variants: dict[str, Variant]


class UserPacker:
    """Packs the road users of one step after another."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    def pack(self, users: Iterable[RoadUser]) -> PackedUsers:
        users = list(users)
        new = {user.id: user.variant for user in users if user.id not in self._known}
        self._known.update(new)
        return PackedUsers(
            tuple(user.id for user in users),
            np.array([user.map_SE3_base for user in users]).reshape(-1, 4, 4),
            np.array([user.velocity_mps for user in users]).reshape(-1, 3),
            tuple(int(user.lights) for user in users),
            new,
        )


class UserUnpacker:
    """Unpacks what one `UserPacker` has packed, in the same order of steps."""

    def __init__(self) -> None:
        self._variants: dict[str, Variant] = {}

    def unpack(self, packed: PackedUsers) -> list[RoadUser]:
        self._variants |= packed.variants
        return [
            RoadUser(name, self._variants[name], pose, velocity_mps, ExteriorLights(lights))
            for name, pose, velocity_mps, lights in zip(
                packed.names, packed.poses, packed.velocities_mps, packed.lights, strict=True
            )
        ]
