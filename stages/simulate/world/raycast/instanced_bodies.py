"""Ray casting at road users: each body's mesh is prepared once, and rays are transformed into its frame.

A scene of all moving meshes would have to be rebuilt for each frame. Instead, one scene holds each variant
once, stacked vertically. A ray that may hit a road user is transformed into that user's frame and cast
there. Nothing is rebuilt, only rays near a road user are cast, and the hits that each user would have
without occluders are known, from which its occlusion is computed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.mesh import Mesh, merge
from advpipe.stages.simulate.world.raycast.scene import Float32, Returns, Scene
from advpipe.stages.simulate.world.raycast.sun_beams import SunBeams
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

    def prepare(self) -> None:
        """See `Scene.prepare`."""
        self._scene.prepare()

    def candidate_hits(self, rays: Float32, users: Sequence[RoadUser]) -> CandidateHits:
        """Cast those of the rays (R, 6) in the map's frame that may hit a road user."""
        slots, map_SE3_box = self._boxes(users)
        chosen, user_of_ray = SortedRays(rays).pairs(map_SE3_box, self._half_m[slots])
        local, start_m = self._local(rays[chosen], map_SE3_box, slots, user_of_ray)
        returns = self._scene.returns(local, slots.astype(np.int32)[user_of_ray])
        returns.range_m[:] += start_m
        returns.panes.range_m[:] += start_m[returns.panes.rays]
        return CandidateHits(chosen, user_of_ray, returns)

    def candidate_sights(self, rays: Float32, users: Sequence[RoadUser]) -> CandidateSights:
        """Cast those of the rays (R, 6) of visible light that may hit a road user."""
        slots, map_SE3_box = self._boxes(users)
        chosen, user_of_ray = SortedRays(rays).pairs(map_SE3_box, self._half_m[slots])
        local, start_m = self._local(rays[chosen], map_SE3_box, slots, user_of_ray)
        sight = self._scene.sight(local, slots.astype(np.int32)[user_of_ray])
        sight.range_m[:] += start_m
        sight.panes.range_m[:] += start_m[sight.panes.rays]
        return CandidateSights(chosen, user_of_ray, sight)

    def shades(self, points_m: Float32, sun: Float32, users: Sequence[RoadUser]) -> npt.NDArray[np.bool_]:
        """Whether a road user is between each of the points (3, N) and the sun, in the direction (3,)."""
        slots, map_SE3_box = self._boxes(users)
        shaded = np.zeros(points_m.shape[1], np.bool_)
        chosen, user_of_ray = SunBeams(points_m, sun).pairs(map_SE3_box, self._half_m[slots])
        rays = np.empty((len(chosen), 6), np.float32)
        rays[:, :3], rays[:, 3:] = points_m[:, chosen].T, sun
        local, _ = self._local(rays, map_SE3_box, slots, user_of_ray)
        shaded[chosen[self._scene.is_met(local, slots.astype(np.int32)[user_of_ray])]] = True
        return shaded

    def _boxes(self, users: Sequence[RoadUser]) -> tuple[npt.NDArray[np.int64], Float64]:
        """The place of each user's variant in the stack, and the pose (4, 4) of its box's centre."""
        slots = np.array([self._slot[user.variant.name] for user in users], dtype=np.int64)
        map_SE3_box = np.array([user.map_SE3_base for user in users], dtype=np.float64).reshape(-1, 4, 4)
        map_SE3_box[:, :3, 3] += map_SE3_box[:, :3, 2] * self._centre_m[slots, None]
        return slots, map_SE3_box

    def _local(
        self,
        rays: Float32,
        map_SE3_box: Float64,
        slots: npt.NDArray[np.int64],
        user_of_ray: npt.NDArray[np.int64],
    ) -> tuple[Float32, Float32]:
        """Rays in the stack's frame, and how far (N,) each has gone by then."""
        local, start_m = self._in_box_frames(rays, map_SE3_box, self._radius_m[slots], user_of_ray)
        local[:, 2] += (self._slot_z_m + self._centre_m)[slots].astype(np.float32)[user_of_ray]
        return local, start_m

    @staticmethod
    def _in_box_frames(
        rays: Float32, map_SE3_box: Float64, radius_m: Float64, box_of_ray: npt.NDArray[np.int64]
    ) -> tuple[Float32, Float32]:
        """Rays in their boxes' frames, starting at the sphere around the box; their distances (N,) to it."""
        # Component by component: numpy is faster on a few long arrays than on many short vectors.
        rotation = np.ascontiguousarray(map_SE3_box[:, :3, :3].reshape(-1, 9).T, np.float32)[:, box_of_ray]
        centre_m = np.ascontiguousarray(map_SE3_box[:, :3, 3].T, np.float32)[:, box_of_ray]
        columns = np.ascontiguousarray(rays.T)
        away, direction = columns[:3] - centre_m, columns[3:]
        start_m = np.maximum(
            -(away * direction).sum(axis=0) - radius_m.astype(np.float32)[box_of_ray], np.float32(0)
        )
        away += start_m * direction
        local = np.empty_like(rays)
        for axis in range(3):
            local[:, axis] = sum(rotation[3 * row + axis] * away[row] for row in range(3))
            local[:, 3 + axis] = sum(rotation[3 * row + axis] * direction[row] for row in range(3))
        return local, start_m
