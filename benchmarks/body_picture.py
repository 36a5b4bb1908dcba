"""Draws the built-in bodies of road users, shaded, each in one of its variants.

python benchmarks/body_picture.py OUT.png [--bodies sedan,bus] [--variant 2] [--seed 3]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from advpipe.pipeline.core.open3d_library import o3d
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.bodies import BODIES, draw_variants
from advpipe.stages.simulate.world.raycast.body_meshes import body_mesh
from advpipe.stages.simulate.world.raycast.materials import COLOUR
from advpipe.stages.simulate.world.raycast.mesh import Mesh

COLUMNS, WIDTH_PX, HEIGHT_PX, FOV_DEG = 6, 300, 220, 36.0
SUN = np.array([0.39, 0.64, 0.66])
BACKGROUND, AMBIENT = 0.93, 0.45


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--bodies", default=",".join(BODIES), help="names with commas; all by default")
    parser.add_argument("--variant", type=int, default=2)
    parser.add_argument("--seed", type=int, default=3)
    given = parser.parse_args()
    variants = draw_variants(np.random.default_rng(given.seed))
    names = given.bodies.split(",")
    rows = -(-len(names) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(2.6 * COLUMNS, 2.2 * rows), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, name in zip(axes.flat, names, strict=False):
        variant = variants[f"{name}.{given.variant}"]
        axis.imshow(shaded(body_mesh(variant)))
        sides = f"{variant.length_m:.2f} x {variant.width_m:.2f} x {variant.height_m:.2f} m"
        axis.set_title(f"{name}\n{sides}", fontsize=7)
    figure.tight_layout()
    figure.savefig(given.out, dpi=80)


def shaded(mesh: Mesh) -> Float64:
    """A picture (HEIGHT_PX, WIDTH_PX, 3) in [0, 1] of a body from its front left, as large as fits."""
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(mesh.vertices_m.astype(np.float32)),
        o3d.core.Tensor(mesh.triangles.astype(np.uint32)),
    )
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    middle = (low + high) / 2
    away_m = max(1.55 * (high - low)[0], 2.1 * (high - low)[2])
    eye = middle + away_m * np.array([0.62, 0.86, 0.36])
    down = [0, 0, -1]  # Open3D's pictures begin at the bottom
    rays = scene.create_rays_pinhole(FOV_DEG, middle, eye, down, WIDTH_PX, HEIGHT_PX)
    found = scene.cast_rays(rays)
    hit = np.isfinite(found["t_hit"].numpy())
    triangles = found["primitive_ids"].numpy()[hit].astype(np.int64)
    light = AMBIENT + (1 - AMBIENT) * np.abs(found["primitive_normals"].numpy()[hit] @ SUN)
    picture = np.full((HEIGHT_PX, WIDTH_PX, 3), BACKGROUND)
    picture[hit] = np.clip(COLOUR[mesh.materials[triangles]] ** (1 / 2.2) * light[:, None] + 0.04, 0, 1)
    return picture


if __name__ == "__main__":
    main()
