"""Rays cast into one mesh; window panes let them go on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.sensors.world import Hits
from advpipe.stages.simulate.world.raycast.materials import REFLECTIVITY, RETROREFLECTIVE, TRANSMITTANCE
from advpipe.stages.simulate.world.raycast.mesh import Mesh

Float32 = npt.NDArray[np.float32]

MAX_PANES = 4
"""Panes of one mesh that a ray passes; behind the last one its light is lost."""

SPECULAR_COS = np.float32(np.cos(np.deg2rad(5.0)))
"""A pane shows itself only to rays this close to its normal: it mirrors, so that at any other angle the
light goes elsewhere (Foster, Sun, Park, Kuipers: VisAGGE, ICRA 2013)."""

STEP_M = np.float32(1e-3)


@dataclass(frozen=True)
class MaterialHits(Hits):
    """Hits, and what they are of: materials (R,) uint8, as in `materials.py`.

    objects: index into the moving road users; -1 the static world; -2 - k parked car k.
    """

    materials: npt.NDArray[np.uint8]

    @classmethod
    def of(
        cls,
        returns: Returns,
        range_m: Float32,
        transmission: Float32,
        objects: npt.NDArray[np.int32],
        occlusion: Float32,
    ) -> MaterialHits:
        """With what the materials of these returns do to light."""
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

    def before(self, range_m: Float32, into: Float32, rays: npt.NDArray[np.int64] | None = None) -> None:
        """Multiplies into `into` (R,) what the panes nearer than `range_m` (R,) leave of the light.

        `rays`, where given, says which of the R rays each ray of these panes is.
        """
        of = self.rays if rays is None else rays[self.rays]
        near = self.range_m < range_m[of]
        np.multiply.at(into, of[near], self.transmittance[near])


@dataclass(frozen=True)
class Returns:
    """What one mesh sends back to R rays, panes apart; columns as in `MaterialHits`."""

    range_m: Float32
    cos_incidence: Float32
    materials: npt.NDArray[np.uint8]
    panes: PanePassages


class Scene:
    """A mesh, ready to be cast into.

    `parts` (T,), where given, divides the triangles among parts that do not see each other.
    """

    def __init__(self, mesh: Mesh, parts: npt.NDArray[np.int32] | None = None) -> None:
        # One more triangle than there are: that of the rays that meet nothing.
        self._materials = np.append(mesh.materials, np.uint8(0))
        self._parts = None if parts is None else np.append(parts, np.int32(-1))
        self._scene = o3d.t.geometry.RaycastingScene()
        if len(mesh.triangles):
            self._scene.add_triangles(
                o3d.core.Tensor(np.ascontiguousarray(mesh.vertices_m, dtype=np.float32)),
                o3d.core.Tensor(mesh.triangles.astype(np.uint32)),
            )

    def cast(self, rays: Float32) -> MaterialHits:
        """Casts rays (R, 6): origin, unit direction."""
        returns = self.returns(rays)
        transmission = np.ones(len(rays), np.float32)
        returns.panes.before(returns.range_m, transmission)
        objects = np.full(len(rays), -1, np.int32)
        return MaterialHits.of(returns, returns.range_m, transmission, objects, np.zeros(0, np.float32))

    def returns(self, rays: Float32, parts: npt.NDArray[np.int32] | None = None) -> Returns:
        """Casts rays (R, 6), each into its own part (R,) where given."""
        range_m, cos, materials = self._first(rays, parts)
        through = _open_panes(range_m, cos, materials)
        passed: list[tuple[npt.NDArray[np.int64], Float32, Float32]] = []
        for _ in range(MAX_PANES):
            if not len(through):
                break
            passed.append((through, range_m[through], TRANSMITTANCE[materials[through]]))
            start_m = range_m[through] + STEP_M
            onward = rays[through]
            onward[:, :3] += start_m[:, None] * onward[:, 3:]
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
        answer = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        range_m: Float32 = answer["t_hit"].numpy()
        triangles = answer["primitive_ids"].numpy().view(np.int32)  # -1, the last one, where nothing was met
        if parts is not None and self._parts is not None:
            range_m[self._parts[triangles] != parts] = np.inf
        cos: Float32 = np.abs(np.einsum("ij,ij->i", answer["primitive_normals"].numpy(), rays[:, 3:]))
        return range_m, np.minimum(cos, np.float32(1)), self._materials[triangles]


def _open_panes(range_m: Float32, cos: Float32, materials: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Which rays met a pane that lets them pass."""
    glass = TRANSMITTANCE[materials] > 0
    return np.flatnonzero(glass & (cos < SPECULAR_COS) & np.isfinite(range_m))
