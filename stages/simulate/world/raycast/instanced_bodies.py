"""Ray casting at road users: each body's mesh is prepared once, and rays are transformed into its frame.

A scene of all moving meshes would have to be rebuilt for each frame. Instead, one scene holds each variant
once, stacked vertically. A ray that may hit a road user is transformed into that user's frame and cast
there. Nothing is rebuilt, only rays near a road user are cast, and the hits that each user would have
without occluders are known, from which its occlusion is computed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import is_

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.camera.long_rows import chosen_columns
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.placed_users import PlacedUsers
from advpipe.stages.simulate.world.raycast.scene import Float32, Returns, Scene
from advpipe.stages.simulate.world.raycast.visible_hits import VisibleHits
from advpipe.stages.simulate.world.raycast.windows import SortedRays


@dataclass(frozen=True)
class CandidateHits:
    """N pairs of a ray and a road user that it may hit (indices), and the returns from these users alone."""

    rays: npt.NDArray[np.int64]
    users: npt.NDArray[np.int64]
    returns: Returns


@dataclass(frozen=True)
class CandidateSights:
    """N pairs of a ray and a road user that it may hit (indices), and what it sees of this user alone.

    Normals are in the user's own frame.
    """

    rays: npt.NDArray[np.int64]
    users: npt.NDArray[np.int64]
    sight: VisibleHits


class InstancedBodies:
    """The meshes of all variants in one scene, stacked vertically."""

    def __init__(self, variants: Mapping[str, Variant], meshes: Mapping[str, Mesh]) -> None:
        self._slot = {name: index for index, name in enumerate(variants)}
        extent = [np.abs(meshes[name].vertices_m) for name in variants]
        # Half extents of a body around its box's centre, including what sticks out of the box.
        self._half_m = np.array(
            [
                [points[:, 0].max(), points[:, 1].max(), max(points[:, 2].max() - v.height_m / 2, 0.01)]
                for points, v in zip(extent, variants.values(), strict=True)
            ]
        ).reshape(-1, 3)
        self._radius_m = np.linalg.norm(self._half_m, axis=1)
        self._centre_m = np.array([variant.height_m / 2 for variant in variants.values()])
        height_m = 2 * float(self._radius_m.max(initial=0.0)) + 1.0
        self._slot_z_m = height_m * (np.arange(len(variants)) - len(variants) / 2)
        lifted = [meshes[name].moved(0, 0, z_m) for name, z_m in zip(variants, self._slot_z_m, strict=True)]
        parts = np.repeat(np.arange(len(lifted), dtype=np.int32), [len(mesh.triangles) for mesh in lifted])
        self._scene = Scene(merge(lifted), parts)
        self._last: PlacedUsers | None = None

    def prepare(self) -> None:
        """See `Scene.prepare`."""
        self._scene.prepare()

    def placed(self, users: Sequence[RoadUser]) -> PlacedUsers:
        """The road users as arrays; those that are already, or were in the last call, stay as they are."""
        if isinstance(users, PlacedUsers):
            return users
        last = self._last
        if last is not None and len(last) == len(users) and all(map(is_, last, users)):
            return last
        slots = np.array([self._slot[user.variant.name] for user in users], dtype=np.int64)
        self._last = placed = PlacedUsers(users, slots, self._centre_m[slots], self._half_m[slots])
        return placed

    def candidate_hits(self, rays: Float32, users: Sequence[RoadUser]) -> CandidateHits:
        """Cast those of the rays (R, 6) in the map's frame that may hit a road user."""
        placed = self.placed(users)
        columns = np.ascontiguousarray(rays.T)
        sorted_rays = SortedRays(columns[:3], columns[3:])
        chosen, user_of_ray = sorted_rays.pairs(placed.map_SE3_box, placed.half_m)
        columns = np.take(columns, chosen, axis=1, mode="clip")
        local, start_m = self._local(columns[:3], columns[3:], placed, user_of_ray)
        returns = self._scene.returns(local, placed.slots.astype(np.int32)[user_of_ray])
        returns.range_m[:] += start_m
        returns.panes.range_m[:] += start_m[returns.panes.rays]
        return CandidateHits(chosen, user_of_ray, returns)

    def candidate_sights(
        self, origin_m: Float32, directions: Float32, users: Sequence[RoadUser]
    ) -> CandidateSights:
        """Cast those rays of visible light from an origin (3, 1) in directions (3, R) that may hit a road
        user."""
        placed = self.placed(users)
        chosen, user_of_ray = placed.in_view(SortedRays(origin_m, directions))
        local, start_m = self._local(origin_m, chosen_columns(directions, chosen), placed, user_of_ray)
        sight = self._scene.sight(local, placed.slots.astype(np.int32)[user_of_ray])
        sight.range_m[:] += start_m
        sight.panes.range_m[:] += start_m[sight.panes.rays]
        return CandidateSights(chosen, user_of_ray, sight)

    def shades(self, points_m: Float32, sun: Float32, users: Sequence[RoadUser]) -> npt.NDArray[np.bool_]:
        """Whether a road user is between each of the points (3, N) and the sun, in the direction (3,)."""
        placed = self.placed(users)
        shaded = np.zeros(points_m.shape[1], np.bool_)
        chosen, user_of_ray = placed.in_shadow(points_m, sun)
        local, _ = self._local(chosen_columns(points_m, chosen), sun[:, None], placed, user_of_ray)
        shaded[chosen[self._scene.is_met(local, placed.slots.astype(np.int32)[user_of_ray])]] = True
        return shaded

    def _local(
        self, origins_m: Float32, directions: Float32, placed: PlacedUsers, user_of_ray: npt.NDArray[np.int64]
    ) -> tuple[Float32, Float32]:
        """Rays (N, 6) in the stack's frame, and how far (N,) each has gone by then: to the sphere around the
        body. origins_m, directions: (3, N), or (3, 1) for all."""
        away = origins_m - np.take(placed.centres_m, user_of_ray, axis=1, mode="clip")
        radius_m = self._radius_m.astype(np.float32)[placed.slots]
        start_m = np.maximum(-(away * directions).sum(axis=0) - radius_m[user_of_ray], np.float32(0))
        away += start_m * directions
        local = np.empty((len(user_of_ray), 6), np.float32)
        for column, row in enumerate(placed.turned_back(user_of_ray, away, directions)):
            local[:, column] = row
        local[:, 2] += (self._slot_z_m + self._centre_m).astype(np.float32)[placed.slots][user_of_ray]
        return local, start_m
