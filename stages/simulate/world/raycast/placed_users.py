"""Road users at one instant as arrays, which all casts of that instant share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import overload

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.body_look import UserTraits
from advpipe.stages.simulate.world.raycast.sun_shadows import SunShadows
from advpipe.stages.simulate.world.raycast.windows import BearingWindow, SortedRays

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]


class PlacedUsers(Sequence[RoadUser]):
    """U road users.

    slots: (U,) int64, places of their variants in the stack of bodies. map_SE3_box: (U, 4, 4), poses of their
    boxes' centres. half_m: (U, 3), half of each side.
    """

    def __init__(self, users: Sequence[RoadUser], slots: Int64, centre_m: Float64, half_m: Float64) -> None:
        self._shadows: tuple[Float32, SunShadows] | None = None
        self._window: tuple[tuple[float, ...], BearingWindow] | None = None
        self._users, self.slots, self.half_m = tuple(users), slots, half_m
        poses = np.array([user.map_SE3_base for user in users], dtype=np.float64).reshape(-1, 4, 4)
        self._map_m_base = np.ascontiguousarray(poses[:, :3, 3].T, np.float32)
        self.map_SE3_box = poses
        self.map_SE3_box[:, :3, 3] += poses[:, :3, 2] * centre_m[:, None]
        self.rotations: Float32 = np.ascontiguousarray(poses[:, :3, :3].reshape(-1, 9).T, np.float32)
        """The rotation of each (9, U), row by row."""
        self.centres_m: Float32 = np.ascontiguousarray(poses[:, :3, 3].T, np.float32)
        """The centre of each box (3, U)."""

    @overload
    def __getitem__(self, index: int) -> RoadUser: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[RoadUser]: ...
    def __getitem__(self, index: int | slice) -> RoadUser | Sequence[RoadUser]:
        return self._users[index]

    def __len__(self) -> int:
        return len(self._users)

    @cached_property
    def traits(self) -> UserTraits:
        """What their looks depend on."""
        return UserTraits.of(self._users)

    def in_shadow(self, points_m: Float32, sun: Float32) -> tuple[Int64, Int64]:
        """See `SunShadows.pairs`; the sun is in one direction (3,) for all points (3, N)."""
        known = self._shadows
        if known is None or not np.array_equal(known[0], sun):
            known = self._shadows = sun, SunShadows(self.map_SE3_box, self.half_m, sun)
        return known[1].pairs(points_m)

    def in_view(self, rays: SortedRays) -> tuple[Int64, Int64]:
        """See `SortedRays.pairs`; most calls have rays from the same place."""
        known = self._window
        if known is None or known[0] != rays.place:
            known = self._window = rays.place, rays.window(self.map_SE3_box, self.half_m)
        return rays.pairs_in(known[1])

    def turned(self, user_of: Int64, vectors: Float32) -> Float32:
        """Vectors (3, N) from the users' frames to the map's axes; user_of: (N,)."""
        rotation = np.take(self.rotations, user_of, axis=1, mode="clip")
        return np.stack([_sum_of_products(rotation[3 * row : 3 * row + 3], vectors) for row in range(3)])

    def turned_back(self, user_of: Int64, *of_vectors: Float32) -> list[Float32]:
        """Vectors (3, N), or one (3, 1) for all, from the map's axes to the users' frames, as rows (N,):
        those of the first vectors, then those of the next."""
        rotation = np.take(self.rotations, user_of, axis=1, mode="clip")
        return [_sum_of_products(rotation[row::3], vectors) for vectors in of_vectors for row in range(3)]

    def local_points(self, user_of: Int64, points_m: Float32) -> Float32:
        """Points (3, N) of the map in the users' base_link."""
        away = points_m - np.take(self._map_m_base, user_of, axis=1, mode="clip")
        return np.stack(self.turned_back(user_of, away))


def _sum_of_products(first: Float32, second: Float32) -> Float32:
    """Component by component: numpy is faster on a few long arrays than on many short vectors."""
    found: Float32 = first[0] * second[0]
    found += first[1] * second[1]
    found += first[2] * second[2]
    return found
