"""Houses of towns: their walls, roofs and rooms; garages and sheds.

In its frame, a building is centred on its ground plan; its length is along x, its front towards positive y.
"""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.stages.simulate.world.raycast.facades import (
    FOOT_M,
    STOREY_M,
    Style,
    back_wall,
    bay_window,
    facade,
)
from advpipe.stages.simulate.world.raycast.leaves import ivy
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.roofs import roof
from advpipe.stages.simulate.world.raycast.shapes import quads, upright

WALLS = ("plaster", "masonry", "facade_concrete", "facade_dark")


def draw_style(storeys: int, rng: np.random.Generator) -> Style:
    """What the facades of one house, or of a row of houses, have in common."""
    sill_m = rng.uniform(0.7, 1.05)
    return Style(
        storeys=storeys,
        wall=WALLS[int(rng.choice(len(WALLS), p=(0.45, 0.33, 0.14, 0.08)))],
        column_m=rng.uniform(2.2, 3.4),
        window=rng.uniform(0.35, 0.65),
        sill_m=sill_m,
        head_m=rng.uniform(2.2, 2.5),
        recess_m=rng.uniform(0.1, 0.28),
        ledges=bool(rng.random() < 0.4),
        balconies=float(rng.choice((0.0, 0.15, 0.5), p=(0.5, 0.3, 0.2))) if storeys > 1 else 0.0,
        curtains=rng.uniform(0.2, 0.7),
    )


def house(
    length_m: float, depth_m: float, style: Style, rng: np.random.Generator, *, joined: bool = False
) -> Mesh:
    """A house; joined: others stand against its sides, which have no windows."""
    parts = []
    for turn, (wide_m, deep_m) in enumerate([(length_m, depth_m), (depth_m, length_m)] * 2):
        is_side = turn % 2 == 1
        if joined and is_side:
            wall = upright([(-wide_m / 2, wide_m / 2, -FOOT_M, style.height_m)], 0.0, style.wall)
        elif turn == 2:
            wall = back_wall(wide_m, style)
        else:
            wall = facade(wide_m, deep_m, style, rng, is_front=turn == 0)
        pose = se3_from_yaw((0, 0, 0), turn * np.pi / 2)
        parts.append(wall.moved(0, deep_m / 2, 0).transformed(pose))
    for storey in range(style.storeys + 1):
        x, y, z = length_m / 2 - 0.05, depth_m / 2 - 0.05, 0.1 + storey * STOREY_M
        parts.append(quads([[(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)]], "room"))
    flat = bool(rng.random() < (0.15 if style.storeys < 3 else 0.6))
    parts.append(roof(length_m, depth_m, style.height_m, style.wall, rng, joined=joined, flat=flat))
    if style.storeys <= 3 and length_m > 7 and rng.random() < 0.35:
        storeys = int(rng.integers(1, min(style.storeys, 2) + 1))
        x = rng.uniform(-0.5, 0.5) * (length_m - 3.0)
        parts.append(bay_window(storeys, style.wall).moved(x, depth_m / 2, 0))
    if rng.random() < 0.12:
        wide_m = rng.uniform(0.3, 0.7) * length_m
        grown = ivy(wide_m, rng.uniform(0.5, 0.95) * style.height_m, rng)
        parts.append(grown.moved(rng.uniform(-0.5, 0.5) * (length_m - wide_m), depth_m / 2, 0))
    return merge(parts)


def garage(rng: np.random.Generator) -> Mesh:
    """A garage of 3.1 m by 6 m with a recessed door."""
    height_m = rng.uniform(2.4, 2.9)
    wall = WALLS[int(rng.integers(3))]
    sides = [
        (-1.55, -1.25, -FOOT_M, height_m),
        (1.25, 1.55, -FOOT_M, height_m),
        (-1.25, 1.25, 2.15, height_m),
    ]
    box = [[(x, -3, -FOOT_M), (x, 3, -FOOT_M), (x, 3, height_m), (x, -3, height_m)] for x in (-1.55, 1.55)]
    back = upright([(-1.55, 1.55, -FOOT_M, height_m)], -3.0, wall)
    door = upright([(-1.25, 1.25, -0.2, 2.15)], 2.85, "frame_white")
    lid = box_mesh((3.3, 6.2, 0.16), "facade_concrete").moved(0, 0, height_m)
    return merge([upright(sides, 3.0, wall), quads(box, wall), back, door, lid])


def shed(rng: np.random.Generator) -> Mesh:
    """A wooden shed of 2 m by 2.4 m whose roof falls to one side."""
    low, high = rng.uniform(1.8, 2.0), rng.uniform(2.2, 2.6)
    x, y = 1.0, 1.2
    walls = [
        [(-x, y, -0.3), (x, y, -0.3), (x, y, high), (-x, y, high)],
        [(-x, -y, -0.3), (x, -y, -0.3), (x, -y, low), (-x, -y, low)],
        *([(s, -y, -0.3), (s, y, -0.3), (s, y, high), (s, -y, low)] for s in (-x, x)),
    ]
    lid = [[(-1.15, -1.4, low), (1.15, -1.4, low), (1.15, 1.4, high + 0.05), (-1.15, 1.4, high + 0.05)]]
    return merge([quads(walls, "planks"), quads(lid, "roof_tile")])
