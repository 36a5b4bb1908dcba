"""Meshes of the user's: every format, set on the ground; and one clear line for what is none."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.scenario.traffic import UserBody
from advpipe.stages.simulate.bodies import BODIES, VARIANTS, draw_variants
from advpipe.stages.simulate.mesh_file import FORMATS
from advpipe.stages.simulate.world.raycast.materials import MATERIAL_ID
from advpipe.stages.simulate.world.raycast.user_mesh import load_mesh


def write_glb(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """A binary glTF 2.0 file: a JSON chunk, then one buffer of positions and indices."""
    positions, indices = vertices.astype("<f4").tobytes(), triangles.astype("<u4").tobytes()
    views = [(0, len(positions)), (len(positions), len(indices))]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": size} for start, size in views],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(vertices),
                "type": "VEC3",
                "min": vertices.min(axis=0).tolist(),
                "max": vertices.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = positions + indices
    chunks = (
        struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    )
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)


def crate(path: Path, size: tuple[float, float, float] = (4.0, 2.0, 1.5)) -> Path:
    """A box somewhere in space, written by Open3D."""
    mesh = o3d.geometry.TriangleMesh.create_box(*size)
    mesh.translate((100.0, -7.0, 3.0))
    mesh.compute_triangle_normals()
    if path.suffix == ".glb":  # Open3D cannot read what it writes itself
        write_glb(path, np.asarray(mesh.vertices), np.asarray(mesh.triangles))
        return path
    o3d.io.write_triangle_mesh(str(path), mesh)
    return path


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_stands_on_the_ground_at_its_size(tmp_path: Path, suffix: str) -> None:
    mesh = load_mesh(str(crate(tmp_path / f"crate{suffix}")), "bodies.crate", "steel", 0.5)
    assert np.allclose(mesh.vertices_m.min(axis=0), [-1.0, -0.5, 0.0], atol=1e-5)
    assert np.allclose(mesh.vertices_m.max(axis=0), [1.0, 0.5, 0.75], atol=1e-5)
    assert len(mesh.triangles) == 12
    assert set(mesh.materials.tolist()) == {MATERIAL_ID["steel"]}


def test_a_user_body_adds_one_variant(tmp_path: Path) -> None:
    body = UserBody(mesh=str(crate(tmp_path / "crate.ply")), label="truck")
    plain = draw_variants(np.random.default_rng(3))
    variants = draw_variants(np.random.default_rng(3), {"crate": body})
    assert set(variants) - set(plain) == {"crate.0"}
    assert len(plain) == VARIANTS * len(BODIES)
    crated = variants["crate.0"]
    assert (crated.length_m, crated.width_m, crated.height_m) == pytest.approx((4.0, 2.0, 1.5))
    assert crated.body.label == "truck"


NAN_PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\nnan 0 0\n1 0 0\n0 1 1\n3 0 1 2\n"
)
CRASHING_PLY = NAN_PLY.replace("nan", "0").replace("3 0 1 2", "4 0 1 2 1000000000")
"""A polygon with a corner that does not exist: Open3D crashes when it divides it into triangles."""
STL_HEAD = b"\0" * 80 + struct.pack("<I", 10**9)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("absent.obj", None, "does not exist; give the path of an .obj"),
        ("empty.ply", b"", "contains no triangles or is not a mesh"),
        ("text.obj", b"this is no mesh\n" * 20, "contains no triangles or is not a mesh"),
        ("noise.glb", bytes(range(256)) * 20, "contains no triangles or is not a mesh"),
        ("noise.stl", bytes(range(256)) * 20, "contains no triangles or is not a mesh"),
        ("huge.stl", STL_HEAD, "contains no triangles or is not a mesh"),
        ("crashing.ply", CRASHING_PLY.encode(), "contains no triangles or is not a mesh"),
        ("noise.off", b"OFF\n3 1 0\nx y z\n", "contains no triangles or is not a mesh"),
        ("nan.ply", NAN_PLY.encode(), "has vertices that are not finite"),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a side of less than 0.01 m"),
        ("far.obj", b"v 0 0 0\nv 9999 0 0\nv 0 9 9\nf 1 2 3\n", "larger than 300 m; set scale"),
        ("bad.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 9\n", "mesh"),
        ("bad.ply", NAN_PLY.replace("nan", "0").replace("3 0 1 2", "3 0 1 7").encode(), "do not exist"),
        ("picture.png", b"\x89PNG", "is none of .obj, .ply, .stl, .glb, .off"),
    ],
)
def test_an_invalid_mesh_is_a_one_line_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, content: bytes | None, message: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(AdvpipeError) as caught:
        load_mesh(str(path), "bodies.mine", "steel", 1.0)
    text = str(caught.value)
    assert text.startswith("bodies.mine.mesh: ")
    assert message in text
    assert "\n" not in text
    out, errors = capfd.readouterr()
    assert not out
    assert not errors


def test_an_unknown_material_names_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(
        AdvpipeError, match=r"bodies.x.material: 'gold' is not a known material; known: .*asphalt, .*steel"
    ):
        load_mesh(str(crate(tmp_path / "crate.obj")), "bodies.x", "gold", 1.0)


def test_a_user_object_stands_on_the_ground_at_its_position(
    tmp_path: Path, boulevard: Any, middle_m: np.ndarray
) -> None:
    from advpipe.pipeline.scenario.environment import UserObject
    from advpipe.stages.simulate.world.raycast.world import RaycastWorld

    given = UserObject(
        mesh=str(crate(tmp_path / "crate.stl")), material="wood", x_m=middle_m[0], y_m=middle_m[1]
    )
    environment = boulevard.scenario.environment.model_copy(update={"objects": (given,)})
    scenario = boulevard.scenario.model_copy(update={"environment": environment})
    world = RaycastWorld(scenario, boulevard.network, boulevard.variants)
    above = np.array([[*(middle_m + (0.3, 0.2, 10.0)), 0, 0, -1]], np.float32)
    hits = world.cast(above, [])
    assert hits.range_m[0] == pytest.approx(8.5, abs=0.01)
    assert hits.materials[0] == MATERIAL_ID["wood"]
