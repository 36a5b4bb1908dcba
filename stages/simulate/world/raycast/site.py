"""What has been built beside the roads so far, and where more may stand."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh
from advpipe.stages.simulate.world.raycast.occupied import Occupied
from advpipe.stages.simulate.world.raycast.terrain import Terrain


@dataclass(frozen=True)
class Site:
    """The ground, what occupies it, and the meshes in the map's frame.

    land: ground taken by parcels, pavements included. footprints: outlines of the houses.
    """

    terrain: Terrain
    occupied: Occupied
    land: Occupied
    meshes: list[Mesh] = field(default_factory=list)
    footprints: list[shapely.Polygon] = field(default_factory=list)

    def place(self, mesh: Mesh, map_SE3_mesh: Float64, length_m: float, width_m: float) -> bool:
        """Add a mesh if the rectangle that it takes about its origin is free; return whether it was."""
        free = self.occupied.take(map_SE3_mesh, length_m, width_m)
        if free:
            self.meshes.append(mesh.transformed(map_SE3_mesh))
        return free

    def ground_m(self, xy_m: Float64) -> float:
        """Height of the ground at one place (2,)."""
        return float(self.terrain.at(np.asarray(xy_m)[None, :2])[0])
