"""User-supplied meshes, each of one material."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.nearest import known_names
from advpipe.stages.simulate.mesh_file import read_mesh_file
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.mesh import Mesh


def load_mesh(path: str, key: str, material: str, scale: float) -> Mesh:
    """The mesh in base_link: x forward, the origin on the ground below its box's centre.

    key: the place in the scenario, for error messages. scale: metres per unit of the mesh.
    Raises AdvpipeError for an unknown material, a missing file, a file without a mesh, or a mesh of an
    impossible size.
    """
    if material not in MATERIAL_ID:
        known = known_names(material, sorted(MATERIAL_ID))
        raise AdvpipeError(f"{key}.material: {material!r} is not a known material; {known}")
    vertices_m, triangles = read_mesh_file(path, key, scale)
    return Mesh(vertices_m, triangles, np.full(len(triangles), MATERIAL_ID[material], np.uint8))
