"""Rays cast at road users: each body's mesh is prepared once, and the rays are brought to it.

A scene of all moving meshes would have to be rebuilt for each frame. Here every variant stands once in
one scene, on a floor of its own. A ray that may meet a road user is moved into that user's frame and
cast there: nothing is rebuilt, only rays near a road user are cast, and what each would meet if nothing
else were there, which occlusion asks for, is known.
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
from advpipe.stages.simulate.world.raycast.windows import Windows


@dataclass(frozen=True)
class Contacts:
    """N pairs of a ray and a road user that it may meet, and what it gets back from that one alone."""

    rays: npt.NDArray[np.int64]
    users: npt.NDArray[np.int64]
    returns: Returns


class InstancedBodies:
    """The meshes of all variants, by their names, floor above floor."""

    def __init__(self, variants: Mapping[str, Variant], meshes: Mapping[str, Mesh]) -> None:
        self._floor = {name: index for index, name in enumerate(variants)}
        extent = [np.abs(meshes[name].vertices_m) for name in variants]
        # Half sides of what a body fills around its box's centre, with what sticks out of the box.
        self._half_m = np.array(
            [
                [points[:, 0].max(), points[:, 1].max(), max(points[:, 2].max() - v.height_m / 2, 0.01)]
                for points, v in zip(extent, variants.values(), strict=True)
            ]
        ).reshape(-1, 3)
        self._radius_m = np.linalg.norm(self._half_m, axis=1)
        self._centre_m = np.array([variant.height_m / 2 for variant in variants.values()])
        height_m = 2 * float(self._radius_m.max(initial=0.0)) + 1.0
        self._lift_m = height_m * (np.arange(len(variants)) - len(variants) / 2)
        lifted = [meshes[name].moved(0, 0, lift) for name, lift in zip(variants, self._lift_m, strict=True)]
        parts = np.repeat(np.arange(len(lifted), dtype=np.int32), [len(mesh.triangles) for mesh in lifted])
        self._scene = Scene(merge(lifted), parts)

    def contacts(self, rays: Float32, users: Sequence[RoadUser]) -> Contacts:
        """Casts those of the rays (R, 6) in the map's frame that may meet a road user."""
        floors = np.array([self._floor[user.variant.name] for user in users], dtype=np.int64)
        map_SE3_box = np.array([user.map_SE3_base for user in users], dtype=np.float64).reshape(-1, 4, 4)
        map_SE3_box[:, :3, 3] += map_SE3_box[:, :3, 2] * self._centre_m[floors, None]
        chosen, of = Windows(rays).pairs(map_SE3_box, self._half_m[floors])
        local, start_m = self._brought(rays[chosen], map_SE3_box, self._radius_m[floors], of)
        local[:, 2] += (self._lift_m + self._centre_m)[floors].astype(np.float32)[of]
        returns = self._scene.returns(local, floors.astype(np.int32)[of])
        returns.range_m[:] += start_m
        returns.panes.range_m[:] += start_m[returns.panes.rays]
        return Contacts(chosen, of, returns)

    @staticmethod
    def _brought(
        rays: Float32, map_SE3_box: Float64, radius_m: Float64, of: npt.NDArray[np.int64]
    ) -> tuple[Float32, Float32]:
        """Rays in the frames of their boxes, started where they enter the sphere around the box."""
        # Component by component: N short vectors side by side are what numpy is quick at.
        rotation = np.ascontiguousarray(map_SE3_box[:, :3, :3].reshape(-1, 9).T, np.float32)[:, of]
        centre_m = np.ascontiguousarray(map_SE3_box[:, :3, 3].T, np.float32)[:, of]
        columns = np.ascontiguousarray(rays.T)
        away, direction = columns[:3] - centre_m, columns[3:]
        start_m = np.maximum(-(away * direction).sum(axis=0) - radius_m.astype(np.float32)[of], np.float32(0))
        away += start_m * direction
        local = np.empty_like(rays)
        for axis in range(3):
            local[:, axis] = sum(rotation[3 * row + axis] * away[row] for row in range(3))
            local[:, 3 + axis] = sum(rotation[3 * row + axis] * direction[row] for row in range(3))
        return local, start_m
