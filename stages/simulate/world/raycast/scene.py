"""Ray casting into one mesh; window panes let rays pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.sensors.world import Hits, SurfaceDetail
from advpipe.stages.simulate.world.raycast.leaf_gaps import LeafGaps
from advpipe.stages.simulate.world.raycast.materials import (
    CLARITY,
    REFLECTIVITY,
    RETROREFLECTIVE,
    SEMANTIC,
    TRANSMITTANCE,
)
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.panes import passed_share
from advpipe.stages.simulate.world.raycast.surface_detail import DetailMap
from advpipe.stages.simulate.world.raycast.visible_hits import PaneCrossings, VisibleHits

Float32 = npt.NDArray[np.float32]
Scalar = TypeVar("Scalar", bound=np.generic)

MAX_PANES = 4
"""Most panes of one mesh that a ray passes; behind the last one, it has no return."""

MAX_SEEN_PANES = 2
"""The same for visible light: both sides of a vehicle. Each further pane costs a cast of a few rays."""

SPECULAR_COS = np.float32(np.cos(np.deg2rad(5.0)))
"""A pane returns only rays this close to its normal: its reflection is specular, so at any other angle it
reflects the light away from the sensor (Foster, Sun, Park, Kuipers: VisAGGE, ICRA 2013)."""

MAX_GAPS = 2
"""Most gaps between leaves that a ray of visible light passes before it meets a leaf."""

STEP_M = np.float32(1e-3)

_ONE_WAY = np.sqrt(CLARITY)


@dataclass(frozen=True)
class MaterialHits(Hits):
    """Hits with their materials (R,) uint8, as in `materials.py`.

    objects: index into the moving road users; -1 for the static world, -2 - k for parked car k. origins:
    the rays (R, 6) and the map with the surfaces' detail, if they have any.
    """

    materials: npt.NDArray[np.uint8]
    origins: tuple[Float32, DetailMap] | None = None

    @property
    def surfaces(self) -> npt.NDArray[np.uint8]:
        """See `Hits`: the semantic classes of the materials."""
        return np.asarray(SEMANTIC[self.materials])

    def detail(self) -> SurfaceDetail | None:
        """See `Hits`."""
        if self.origins is None:
            return None
        rays, details = self.origins
        return details.at(rays, self.range_m, self.materials, self.objects == -1)

    @classmethod
    def of(
        cls,
        returns: Returns,
        range_m: Float32,
        transmission: Float32,
        objects: npt.NDArray[np.int32],
        occlusion: Float32,
    ) -> MaterialHits:
        """Hits with the reflectivity and retroreflectivity of the returns' materials."""
        materials = returns.materials
        return cls(
            range_m,
            returns.cos_incidence,
            REFLECTIVITY[materials],
            RETROREFLECTIVE[materials],
            transmission,
            objects,
            occlusion,
            materials,
        )


@dataclass(frozen=True)
class PanePassages:
    """E passages of rays through panes. rays: (E,) int64. range_m, transmittance: (E,) float32."""

    rays: npt.NDArray[np.int64]
    range_m: Float32
    transmittance: Float32

    def attenuate(
        self, range_m: Float32, transmission: Float32, rays: npt.NDArray[np.int64] | None = None
    ) -> None:
        """Multiply `transmission` (R,) by the transmittance of the panes nearer than `range_m` (R,).

        rays: if given, the index among the R rays of each ray of these panes.
        """
        ray_of_pane = self.rays if rays is None else rays[self.rays]
        near = self.range_m < range_m[ray_of_pane]
        np.multiply.at(transmission, ray_of_pane[near], self.transmittance[near])


@dataclass(frozen=True)
class Returns:
    """The returns of R rays from one mesh, apart from panes they pass; columns as in `MaterialHits`."""

    range_m: Float32
    cos_incidence: Float32
    materials: npt.NDArray[np.uint8]
    panes: PanePassages


class Scene:
    """A mesh, ready for ray casting.

    `parts` (T,), if given, assigns each triangle to a part; a ray hits triangles of its own part only.
    """

    def __init__(self, mesh: Mesh, parts: npt.NDArray[np.int32] | None = None) -> None:
        # The last entry, beyond the triangles, is for rays that hit nothing.
        self._materials = np.append(mesh.materials, np.uint8(0))
        self._parts = None if parts is None else np.append(parts, np.int32(-1))
        self._normals = np.ascontiguousarray(mesh.unit_normals().T, np.float32)
        self._is_pane = np.append(TRANSMITTANCE[mesh.materials] > 0, False)
        self._vertices_m = np.ascontiguousarray(mesh.vertices_m, np.float32)
        self._triangles = mesh.triangles.astype(np.uint32)
        self._leaf_gaps = LeafGaps(self._vertices_m, self._triangles, mesh.materials)

    @cached_property
    def _scene(self) -> o3d.t.geometry.RaycastingScene:
        """Made for the first cast: a process that casts nothing needs none, and it cannot be pickled."""
        scene = o3d.t.geometry.RaycastingScene()
        if len(self._triangles):
            scene.add_triangles(o3d.core.Tensor(self._vertices_m), o3d.core.Tensor(self._triangles))
        return scene

    def prepare(self) -> None:
        """Do now what the first cast would have to do before: a tree of the triangles."""
        self._first(np.array([[0, 0, 0, 0, 0, 1]], np.float32), None)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_scene"}

    def cast(self, rays: Float32) -> MaterialHits:
        """Cast rays (R, 6): origin in metres, unit direction."""
        returns = self.returns(rays)
        transmission = np.ones(len(rays), np.float32)
        returns.panes.attenuate(returns.range_m, transmission)
        objects = np.full(len(rays), -1, np.int32)
        return MaterialHits.of(returns, returns.range_m, transmission, objects, np.zeros(0, np.float32))

    def returns(self, rays: Float32, parts: npt.NDArray[np.int32] | None = None) -> Returns:
        """Cast rays (R, 6), each into its own part (R,) if given."""
        range_m, cos, materials = self._first(rays, parts)
        through = _open_panes(range_m, cos, materials)
        passed: list[tuple[npt.NDArray[np.int64], Float32, Float32]] = []
        for _ in range(MAX_PANES):
            if not len(through):
                break
            passed.append((through, range_m[through], passed_share(materials[through], cos[through])))
            start_m = range_m[through] + STEP_M
            onward = _onward(rays, through, start_m)
            found = self._first(onward, None if parts is None else parts[through])
            range_m[through], cos[through], materials[through] = start_m + found[0], found[1], found[2]
            through = through[_open_panes(*found)]
        range_m[through] = np.inf
        if not passed:
            passed = [(through, range_m[:0], range_m[:0])]
        columns = (np.concatenate(column) for column in zip(*passed, strict=True))
        return Returns(range_m, cos, materials, PanePassages(*columns))

    def _first(
        self, rays: Float32, parts: npt.NDArray[np.int32] | None
    ) -> tuple[Float32, Float32, npt.NDArray[np.uint8]]:
        if len(self._materials) == 1:
            count = len(rays)
            return (
                np.full(count, np.inf, np.float32),
                np.zeros(count, np.float32),
                np.zeros(count, np.uint8),
            )
        result = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        range_m: Float32 = result["t_hit"].numpy()
        triangles = (
            result["primitive_ids"].numpy().view(np.int32)
        )  # -1, the last entry, where nothing was hit
        if parts is not None and self._parts is not None:
            range_m[self._parts[triangles] != parts] = np.inf
        cos: Float32 = np.abs(np.einsum("ij,ij->i", result["primitive_normals"].numpy(), rays[:, 3:]))
        return range_m, np.minimum(cos, np.float32(1)), self._materials[triangles]

    def sight(self, rays: Float32, parts: npt.NDArray[np.int32] | None = None) -> VisibleHits:
        """Cast rays (R, 6) of visible light, each into its own part (R,) if given.

        They pass every pane at every angle; after `MAX_SEEN_PANES`, the next one is opaque. They also pass
        gaps between leaves, which the wide beams of LiDARs do not.
        """
        range_m, normals, triangles = self._past_gaps(rays, parts)
        through = np.flatnonzero(of_triangles(self._is_pane, triangles))
        passed: list[tuple[npt.NDArray[np.int64], Float32, Float32, Float32]] = []
        for _ in range(MAX_SEEN_PANES):
            if not len(through):
                break
            panes = self._materials[triangles[through]]
            at_m = np.take(range_m, through)
            passed.append((through, at_m, _ONE_WAY[panes], np.take(normals, through, axis=0)))
            start_m = at_m + STEP_M
            onward = _onward(rays, through, start_m)
            found_m, found_normals, found = self._past_gaps(onward, None if parts is None else parts[through])
            range_m[through], normals[through], triangles[through] = start_m + found_m, found_normals, found
            through = through[self._is_pane[found]]
        if not passed:
            passed = [(through, range_m[:0], range_m[:0], normals[:0])]
        columns = (np.concatenate(column) for column in zip(*passed, strict=True))
        return VisibleHits(range_m, normals, triangles, PaneCrossings(*columns))

    def _past_gaps(
        self, rays: Float32, parts: npt.NDArray[np.int32] | None
    ) -> tuple[Float32, Float32, npt.NDArray[np.int32]]:
        """Range, normal (of either side), and triangle of the first surface of each ray that is no gap."""
        range_m, normals, triangles, uv = self._nearest(rays, parts)
        if not self._leaf_gaps.has_any:
            return range_m, normals, triangles
        passing = self._leaf_gaps.open_rays(triangles, uv)
        for _ in range(MAX_GAPS):
            if not len(passing):
                break
            start_m = np.take(range_m, passing) + STEP_M
            onward = _onward(rays, passing, start_m)
            found_m, found_normals, found, uv = self._nearest(
                onward, None if parts is None else parts[passing]
            )
            range_m[passing], normals[passing], triangles[passing] = start_m + found_m, found_normals, found
            passing = passing[self._leaf_gaps.open_rays(found, uv)]
        return range_m, normals, triangles

    @property
    def materials(self) -> npt.NDArray[np.uint8]:
        """The materials (T + 1,) of the triangles, and 0 for none."""
        return self._materials

    def normals_of(self, triangles: npt.NDArray[np.int32], out: Float32) -> None:
        """Write the normals, of either side, of triangles (N,) as rows (3, N)."""
        places = triangles.astype(np.intp)
        for axis in range(3):
            np.take(self._normals[axis], places, out=out[axis], mode="clip")

    def is_occluded(self, rays: Float32) -> npt.NDArray[np.bool_]:
        """Whether each ray (R, 6) meets anything, panes included."""
        if len(self._materials) == 1:
            return np.zeros(len(rays), np.bool_)
        occluded: npt.NDArray[np.bool_] = self._scene.test_occlusions(
            o3d.core.Tensor.from_numpy(rays)
        ).numpy()
        return occluded

    def is_met(self, rays: Float32, parts: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
        """Whether each ray (R, 6) meets its own part (R,) first, panes included."""
        met: npt.NDArray[np.bool_] = self._nearest(rays, parts)[2] >= 0
        return met

    def _nearest(
        self, rays: Float32, parts: npt.NDArray[np.int32] | None
    ) -> tuple[Float32, Float32, npt.NDArray[np.int32], Float32]:
        """Range, normal (of either side), triangle, and place in it (N, 2) of the first hit of each ray."""
        count = len(rays)
        if len(self._materials) == 1 or not count:
            nothing = np.full(count, np.inf, np.float32), np.zeros((count, 3), np.float32)
            return *nothing, np.full(count, -1, np.int32), np.zeros((count, 2), np.float32)
        result = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        range_m: Float32 = result["t_hit"].numpy()
        triangles: npt.NDArray[np.int32] = result["primitive_ids"].numpy().view(np.int32)
        normals: Float32 = result["primitive_normals"].numpy()
        if parts is not None and self._parts is not None:
            other = np.flatnonzero(of_triangles(self._parts, triangles) != parts)
            range_m[other], triangles[other] = np.inf, -1
        return range_m, normals, triangles, result["primitive_uvs"].numpy()


def _onward(rays: Float32, chosen: npt.NDArray[np.int64], start_m: Float32) -> Float32:
    """The chosen rays (N, 6), from `start_m` (N,) farther on."""
    onward: Float32 = np.take(rays, chosen, axis=0)
    for axis in range(3):
        onward[:, axis] += start_m * onward[:, 3 + axis]
    return onward


def of_triangles(values: npt.NDArray[Scalar], triangles: npt.NDArray[np.int32]) -> npt.NDArray[Scalar]:
    """The values (N,) of triangles (N,), the last one for none: -1, which is the greatest unsigned index."""
    return np.take(values, triangles.view(np.uint32), mode="clip")


def _open_panes(range_m: Float32, cos: Float32, materials: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Indices of the rays that hit a pane and pass it."""
    glass = TRANSMITTANCE[materials] > 0
    return np.flatnonzero(glass & (cos < SPECULAR_COS) & np.isfinite(range_m))
