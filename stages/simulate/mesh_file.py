"""Reading of user-supplied mesh files: checked, and placed on the ground."""

from __future__ import annotations

import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.geometry.transforms import Float64

FORMATS = (".obj", ".ply", ".stl", ".glb", ".off")
MAX_SIDE_M = 300.0
MIN_SIDE_M = 0.01
MAX_TRIANGLES = 500_000


def read_mesh_file(path: str, key: str, scale: float) -> tuple[Float64, npt.NDArray[np.int64]]:
    """Read the vertices (V, 3) in metres and triangles (T, 3) of a mesh: x forward, the origin on the ground
    below its box's centre.

    key: the place in the scenario, for error messages. scale: metres per unit of the mesh.
    Raises AdvpipeError for a missing file, one without a mesh, or a mesh of an impossible size.
    """
    file = Path(path)
    if not file.is_file():
        state = "is not a file" if file.exists() else "does not exist"
        raise AdvpipeError(f"{key}.mesh: {file} {state}; give the path of an {', '.join(FORMATS)} file")
    if file.suffix.lower() not in FORMATS:
        raise AdvpipeError(f"{key}.mesh: {file} is none of {', '.join(FORMATS)}; convert it")
    vertices, triangles = _read(file, file.stat().st_mtime_ns)
    vertices_m = vertices * scale
    problem = _problem(vertices_m, triangles)
    if problem is not None:
        raise AdvpipeError(f"{key}.mesh: {file} {problem}")
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices_m, triangles = vertices_m[used], triangles.reshape(-1, 3)
    low, high = vertices_m.min(axis=0), vertices_m.max(axis=0)
    return vertices_m - [*((low[:2] + high[:2]) / 2), low[2]], triangles


@lru_cache(maxsize=16)
def _read(file: Path, modified_ns: int) -> tuple[Float64, npt.NDArray[np.int64]]:
    """Vertices (V, 3) and triangles (T, 3); both empty if the file is not a mesh.

    Open3D runs in a separate process, since a damaged .ply can crash it.
    modified_ns: of the file, for the cache: a mesh with many uses is read once.
    """
    import advpipe.pipeline.core.open3d_library  # noqa: F401  reports a missing library clearly

    nothing = np.empty((0, 3)), np.empty((0, 3), np.int64)
    if _is_truncated(file):
        return nothing
    with scratch_folder() as scratch:
        arrays = scratch / "mesh.npz"
        command = [sys.executable, "-c", _READER, str(file.absolute()), str(arrays), *sys.path]
        done = subprocess.run(
            command, capture_output=True
        )  # drops messages of C libraries; our error replaces them
        if done.returncode != 0 or not arrays.is_file():
            return nothing
        with np.load(arrays) as read:
            return read["vertices"], read["triangles"]


_READER = """
import sys
file, arrays = sys.argv[1:3]
sys.path[:] = sys.argv[3:]
import numpy
from advpipe.pipeline.core.open3d_library import o3d
mesh = o3d.io.read_triangle_mesh(file)
vertices, triangles = numpy.array(mesh.vertices, numpy.float64), numpy.array(mesh.triangles, numpy.int64)
numpy.savez(arrays, vertices=vertices, triangles=triangles)
"""


def _is_truncated(file: Path) -> bool:
    """Whether a binary .stl is shorter than declared: Open3D would allocate the declared size."""
    if file.suffix.lower() != ".stl":
        return False
    with file.open("rb") as stream:
        head = stream.read(84)
    if head.lstrip().startswith(b"solid"):
        return False
    return len(head) < 84 or file.stat().st_size < 84 + 50 * int.from_bytes(head[80:], "little")


def _problem(vertices_m: Float64, triangles: npt.NDArray[np.int64]) -> str | None:
    """The problem of a mesh, as the end of a sentence about its file; None for a valid one."""
    if not len(vertices_m) or not len(triangles):
        return "contains no triangles or is not a mesh; export it again"
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
