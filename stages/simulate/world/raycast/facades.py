"""Facades with depth: recessed windows and doors, bays, balconies, ledges, and the rooms behind the panes.

A facade stands in the plane y = 0 and is seen from positive y, the street; the house is behind it. x runs
along it, z upward.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.shapes import quads, upright

STOREY_M = 2.9
FOOT_M = 1.5
"""How far walls reach below the ground, which may slope."""

STEPS_M = 0.9
"""How far the steps of an entrance reach into the street's side."""

BULGE_M = 0.75
"""How far bay windows do."""


@dataclass(frozen=True)
class Style:
    """What the facades of a house have in common.

    storeys: number of them. wall: its material. column_m: distance of windows. window: their share of it.
    sill_m, head_m: from and to which height in a storey they reach. recess_m: how deep panes lie in the wall.
    ledges: whether there are cornices between the storeys. balconies, curtains: shares of the windows.
    """

    storeys: int
    wall: str
    column_m: float
    window: float
    sill_m: float
    head_m: float
    recess_m: float
    ledges: bool
    balconies: float
    curtains: float

    @property
    def height_m(self) -> float:
        return self.storeys * STOREY_M + 0.5


def facade(wide_m: float, depth_m: float, style: Style, rng: np.random.Generator, is_front: bool) -> Mesh:
    """The wall, its openings, and the rooms, no deeper than half of the house's depth."""
    columns = max(int(wide_m // style.column_m), 1)
    edges = np.linspace(-wide_m / 2, wide_m / 2, columns + 1)
    half_m = style.window * (edges[1] - edges[0]) / 2 * rng.uniform(0.8, 1.1, columns)
    half_m = np.minimum(half_m, 0.45 * (edges[1] - edges[0]))
    middles = (edges[:-1] + edges[1:]) / 2
    floor = STOREY_M * np.arange(style.storeys)[:, None]
    left, right = (np.broadcast_to(middles + side * half_m, (style.storeys, columns)) for side in (-1, 1))
    low, high = (np.broadcast_to(floor + level, left.shape).copy() for level in (style.sill_m, style.head_m))
    door = int(rng.integers(columns)) if is_front else -1
    if is_front:
        low[0, door] = 0.25
    holes = np.stack([left, right, low, high], axis=-1)
    parts = [_wall(holes, edges, style)]
    holes = holes.reshape(-1, 4)
    is_door = np.arange(len(holes)) == door
    if is_front:
        parts += [_reveals(holes, style), *_details(holes, wide_m, door, style, rng)]
    recess_m = style.recess_m
    parts.append(upright(holes[~is_door], -recess_m, "pane"))
    parts.append(upright(holes[is_door], -recess_m, "door"))
    parts += _rooms(holes, edges, max(depth_m / 2 - 0.3, 1.0), style, rng)
    return merge(parts)


def back_wall(wide_m: float, style: Style) -> Mesh:
    """The side of a house that no street sees: panes on a plain wall."""
    columns = max(int(wide_m // style.column_m), 1)
    pitch_m = wide_m / columns
    middles = (np.arange(columns) + 0.5) * pitch_m - wide_m / 2
    floor = STOREY_M * np.repeat(np.arange(style.storeys), columns)
    x, half_m = np.tile(middles, style.storeys), style.window * pitch_m / 2
    panes = np.stack([x - half_m, x + half_m, floor + style.sill_m, floor + style.head_m], axis=1)
    wall = upright([(-wide_m / 2, wide_m / 2, -FOOT_M, style.height_m)], 0.0, style.wall)
    return merge([wall, upright(panes, 0.02, "pane")])


def _wall(holes: Float64, edges: Float64, style: Style) -> Mesh:
    """The wall around its openings (storeys, columns, 4): a panel below and beside each, and the top."""
    storeys, columns = holes.shape[:2]
    left, right, low, high = np.moveaxis(holes, -1, 0)
    start, end = (np.broadcast_to(each, (storeys, columns)) for each in (edges[:-1], edges[1:]))
    below = np.concatenate([np.full((1, columns), -FOOT_M), high[:-1]])
    panels = [(start, left, low, high), (right, end, low, high), (start, end, below, low)]
    top = (edges[:1], edges[-1:], high[-1].max(keepdims=True), np.array([style.height_m]))
    sides = [np.stack(panel, axis=-1).reshape(-1, 4) for panel in (*panels, top)]
    return upright(np.concatenate(sides), 0.0, style.wall)


def _reveals(holes: Float64, style: Style) -> Mesh:
    """The sides of the openings between the wall and the panes, and a bar across each pane."""
    a, b, low, high = holes.T
    front, back = np.zeros(len(a)), np.full(len(a), -style.recess_m)

    def corner(x: Float64, y: Float64, z: Float64) -> Float64:
        return np.stack([x, y, z], axis=-1)

    rings = [(a, low), (b, low), (b, high), (a, high)]
    sides = [
        np.stack([corner(x, front, z), corner(u, front, w), corner(u, back, w), corner(x, back, z)], axis=1)
        for (x, z), (u, w) in zip(rings, [*rings[1:], rings[0]], strict=True)
    ]
    middle = (a + b) / 2
    bars = np.stack([middle - 0.04, middle + 0.04, low, high], axis=1)
    frame = upright(bars, 0.05 - style.recess_m, "frame_white")
    return merge([quads(np.concatenate(sides), style.wall), frame])


def _details(holes: Float64, wide_m: float, door: int, style: Style, rng: np.random.Generator) -> list[Mesh]:
    """Plinth, ledges, sills, rain pipe, balconies, and the entrance with its steps and canopy."""
    parts = [_ledge(-wide_m / 2, holes[door, 0] - 0.1, 0.45, 0.05, "facade_concrete", 0.45 + FOOT_M)]
    parts.append(_ledge(holes[door, 1] + 0.1, wide_m / 2, 0.45, 0.05, "facade_concrete", 0.45 + FOOT_M))
    for storey in range(1, style.storeys + 1) if style.ledges else (style.storeys,):
        parts.append(_ledge(-wide_m / 2, wide_m / 2, storey * STOREY_M + 0.05, 0.12, style.wall, 0.18))
    windows = np.delete(holes, door, axis=0)
    sills = np.stack(
        [windows[:, 0] - 0.06, windows[:, 1] + 0.06, windows[:, 2] - 0.07, windows[:, 2]], axis=1
    )
    parts.append(upright(sills, 0.07, "frame_white"))
    has_balcony = (rng.random(len(windows)) < style.balconies) & (windows[:, 2] > STOREY_M)
    parts += [_balcony(window, rng) for window in windows[has_balcony]]
    pipe = box_mesh((0.1, 0.1, style.height_m - 0.1), "steel")
    parts.append(pipe.moved(float(rng.choice((-1, 1))) * (wide_m / 2 - 0.15), 0.08, 0))
    middle = float(holes[door, :2].mean())
    for step, rise_m in enumerate((0.25, 0.13)):
        size = (1.5 + 0.3 * step, STEPS_M * (0.55 + 0.45 * step), rise_m + 0.5)
        parts.append(box_mesh(size, "concrete").moved(middle, size[1] / 2, -0.5))
    if rng.random() < 0.6:
        parts.append(box_mesh((1.8, 0.9, 0.1), "facade_concrete").moved(middle, 0.45, holes[door, 3] + 0.12))
    return parts


def _ledge(from_m: float, to_m: float, top_m: float, out_m: float, material: str, high_m: float) -> Mesh:
    """A band in front of the wall: its face, its top and its underside."""
    y, low = out_m, top_m - high_m
    flat = [[(from_m, 0, z), (to_m, 0, z), (to_m, y, z), (from_m, y, z)] for z in (low, top_m)]
    face = [(from_m, y, low), (to_m, y, low), (to_m, y, top_m), (from_m, y, top_m)]
    return quads([*flat, face], material)


def _balcony(window: Float64, rng: np.random.Generator) -> Mesh:
    """A slab with a parapet of bars or of panels."""
    out_m, floor_m = rng.uniform(0.8, 1.2), float(np.floor(window[2] / STOREY_M) * STOREY_M)
    half = (window[1] - window[0]) / 2 + 0.45
    slab = box_mesh((2 * half, out_m, 0.16), "facade_concrete").moved(0, out_m / 2, floor_m)
    low, top = floor_m + 0.16, floor_m + 1.15
    if rng.random() < 0.5:
        x = np.arange(-half, half, 0.14)
        bars = np.stack(np.broadcast_arrays(x, x + 0.025, low, top), axis=1)
        front = upright([*bars, (-half, half, top - 0.06, top)], out_m, "fence_metal")
    else:
        front = upright([(-half, half, low + 0.05, top)], out_m, "frame_white")
    ends = [[(x, 0, low), (x, out_m, low), (x, out_m, top), (x, 0, top)] for x in (-half, half)]
    return merge([slab, front, quads(ends, "frame_white")]).moved(float(window[:2].mean()), 0, 0)


def _rooms(
    holes: Float64, edges: Float64, deepest_m: float, style: Style, rng: np.random.Generator
) -> list[Mesh]:
    """The rooms of each storey, one to three windows wide, each of a depth of its own; some curtains."""
    backs: list[tuple[float, float, float, float]] = []
    depths, partitions = [], []
    for storey in range(style.storeys):
        low, high = storey * STOREY_M + 0.1, (storey + 1) * STOREY_M
        column = 0
        while column < len(edges) - 1:
            after = min(column + int(rng.integers(1, 4)), len(edges) - 1)
            depth_m = min(rng.uniform(1.6, 6.5), deepest_m)
            backs.append((edges[column] + 0.04, edges[after] - 0.04, low, high))
            depths.append(-depth_m)
            x, y = edges[after], -style.recess_m - 0.02
            if after < len(edges) - 1:
                partitions.append([(x, y, low), (x, -depth_m, low), (x, -depth_m, high), (x, y, high)])
            column = after
    light = rng.random(len(backs)) < 0.5
    walls = [
        upright(np.array(backs)[chosen], np.array(depths)[chosen], material)
        for chosen, material in ((light, "room_light"), (~light, "room"))
    ]
    hung = holes[rng.random(len(holes)) < style.curtains].copy()
    drawn = rng.uniform(0.25, 1.0, len(hung))
    hung[:, 1] = hung[:, 0] + drawn * (hung[:, 1] - hung[:, 0])
    hung[:, 2] = np.where(rng.random(len(hung)) < 0.3, (hung[:, 2] + hung[:, 3]) / 2, hung[:, 2])
    curtains = upright(hung, -style.recess_m - rng.uniform(0.05, 0.2, len(hung)), "curtain")
    return [*walls, quads(partitions, "room"), curtains]


def bay_window(storeys: int, material: str) -> Mesh:
    """A bay with a window on each of its three sides, over the first storeys."""
    top = storeys * STOREY_M - 0.1
    plan = [(-1.3, 0.0), (-0.8, BULGE_M), (0.8, BULGE_M), (1.3, 0.0)]
    solid: list[list[tuple[float, float, float]]] = []
    glass: list[list[tuple[float, float, float]]] = []
    for (x, y), (u, v) in itertools.pairwise(plan):
        levels = [-FOOT_M]
        for storey in range(storeys):
            levels += [storey * STOREY_M + 0.8, storey * STOREY_M + 2.35]
        levels.append(top)
        for index, (low, high) in enumerate(itertools.pairwise(levels)):
            sheet = [(x, y, low), (u, v, low), (u, v, high), (x, y, high)]
            (glass if index % 2 else solid).append(sheet)
    roof = [[(x, y, top) for x, y in plan]]
    return merge([quads(solid + roof, material), quads(glass, "pane")])
