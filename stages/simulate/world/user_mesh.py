"""Meshes of the user's: read, checked, and set on the ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.simulate.world.materials import MATERIAL_ID
from advpipe.stages.simulate.world.mesh import Mesh

FORMATS = (".obj", ".ply", ".stl", ".glb", ".off")
MAX_SIDE_M = 300.0
MIN_SIDE_M = 0.01
MAX_TRIANGLES = 500_000


def load_mesh(path: str, key: str, material: str, scale: float) -> Mesh:
    """The mesh of one material in base_link: x forward, the origin on the ground below its box's centre.

    `key` is the place in the scenario that an error names. `scale`: metres for each unit of the mesh.
    Raises AdvpipeError for a file that is none, holds no mesh, or a mesh that nobody could meet.
    """
    file = Path(path)
    if material not in MATERIAL_ID:
        known = ", ".join(sorted(MATERIAL_ID))
        raise AdvpipeError(f"{key}.material: {material!r} is no material; known: {known}")
    if not file.is_file():
        state = "is no file" if file.exists() else "does not exist"
        raise AdvpipeError(f"{key}.mesh: {file} {state}; give the path of an {', '.join(FORMATS)} file")
    if file.suffix.lower() not in FORMATS:
        raise AdvpipeError(f"{key}.mesh: {file} is none of {', '.join(FORMATS)}; convert it")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            read = o3d.io.read_triangle_mesh(str(file))
        except (RuntimeError, ValueError, MemoryError, UnicodeError):
            read = o3d.geometry.TriangleMesh()
    vertices_m = np.asarray(read.vertices, dtype=np.float64) * scale
    triangles = np.asarray(read.triangles, dtype=np.int64)
    problem = _problem(vertices_m, triangles)
    if problem is not None:
        raise AdvpipeError(f"{key}.mesh: {file} {problem}")
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices_m, triangles = vertices_m[used], triangles.reshape(-1, 3)
    low, high = vertices_m.min(axis=0), vertices_m.max(axis=0)
    vertices_m = vertices_m - [*((low[:2] + high[:2]) / 2), low[2]]
    return Mesh(vertices_m, triangles, np.full(len(triangles), MATERIAL_ID[material], np.uint8))


def _problem(vertices_m: np.ndarray, triangles: np.ndarray) -> str | None:
    """What is wrong with a mesh, as the end of a sentence about its file."""
    if not len(vertices_m) or not len(triangles):
        return "holds no triangles, or is no mesh at all; export it again"
    if len(triangles) > MAX_TRIANGLES:
        return f"has {len(triangles)} triangles, more than {MAX_TRIANGLES}; simplify it"
    if triangles.min() < 0 or triangles.max() >= len(vertices_m):
        return "has triangles with corners that do not exist; export it again"
    corners_m = vertices_m[triangles.ravel()]
    if not np.isfinite(corners_m).all():
        return "has vertices that are not finite; export it again"
    size_m = np.ptp(corners_m, axis=0)
    text = " x ".join(f"{side:.3g}" for side in size_m)
    if size_m.max() > MAX_SIDE_M:
        return f"measures {text} m, larger than {MAX_SIDE_M:g} m; set scale, metres for each of its units"
    if size_m.min() < MIN_SIDE_M:
        return f"measures {text} m: a side of less than {MIN_SIDE_M:g} m; set scale, or give it a thickness"
    return None
