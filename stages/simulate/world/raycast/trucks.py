"""Trucks: a cab with windows before a load box, and a tractor with its semi-trailer."""

from __future__ import annotations

import numpy as np
import shapely

from advpipe.stages.simulate.world.raycast.cars import _seat, _sitting
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, ellipsoid, merge
from advpipe.stages.simulate.world.raycast.shapes import band, panels, wheel

TAPE_M = 0.06
"""Contour marking of ECE regulation 104: retroreflective tape along the edges of large trucks."""

THREE_AXLES_M = 9.0
"""Box trucks longer than this have a third axle."""


def box_truck(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A rigid truck with a box body, of two axles, or of three if it is long."""
    cab_m = 2.0
    load_m = length_m - cab_m - 0.2
    load = box_mesh((load_m, width_m, height_m - 0.95), "tarpaulin").moved(-(length_m - load_m) / 2, 0, 0.95)
    chassis = box_mesh((length_m - 0.6, 0.9, 0.35), "frame").moved(-0.1, 0, 0.55)
    axles = [0.5 * length_m - 1.3, -0.24 * length_m]
    if length_m > THREE_AXLES_M:
        axles.append(axles[-1] - 1.3)
    cab = _cab(length_m / 2, cab_m, 0.97 * width_m, min(2.55, 0.8 * height_m), paint, pose)
    parts = [*cab, load, chassis, *_wheels(axles, width_m)]
    return merge([*parts, *_rear(length_m, width_m, height_m)])


def tipper(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A tipper truck of three axles: an open skip, loaded with soil above 0.5 of `pose`."""
    cab_m, floor_m = 2.1, 1.15
    front_m, back_m = length_m / 2 - cab_m - 0.15, -length_m / 2
    long_m, high_m = front_m - back_m, height_m - floor_m
    low_m, wall_m = 0.72 * high_m, 0.08
    middle_m = (front_m + back_m) / 2
    skip = [
        box_mesh((long_m, width_m, wall_m), "frame").moved(middle_m, 0, floor_m),
        *(
            box_mesh((long_m, wall_m, low_m), paint).moved(middle_m, s * (width_m - wall_m) / 2, floor_m)
            for s in (-1, 1)
        ),
        box_mesh((wall_m, width_m, low_m), paint).moved(back_m + wall_m / 2, 0, floor_m),
        box_mesh((wall_m, width_m, high_m), paint).moved(front_m - wall_m / 2, 0, floor_m),
        box_mesh((0.7, width_m, wall_m), paint).moved(front_m + 0.3, 0, height_m - wall_m),
    ]
    if pose > 0.5:
        heap = ellipsoid(
            (middle_m, 0, floor_m + 0.5 * high_m), (0.47 * long_m, 0.47 * width_m, 0.45 * high_m), "soil", 5
        )
        skip.append(heap)
    chassis = box_mesh((length_m - 0.6, 0.9, 0.4), "frame").moved(-0.1, 0, 0.6)
    axles = [0.5 * length_m - 1.4, -0.5 * length_m + 2.5, -0.5 * length_m + 1.2]
    cab = _cab(length_m / 2, cab_m, 0.98 * width_m, 0.93 * height_m, paint, pose)
    return merge([*cab, *skip, chassis, *_wheels(axles, width_m), *_rear(length_m, width_m, 2.0)])


def semi_trailer(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A tractor of two axles and a curtain-sided trailer of three, straight behind one another."""
    front_m, back_m = length_m / 2, -length_m / 2
    trailer_m = 0.825 * length_m
    load = box_mesh((trailer_m, width_m, height_m - 1.2), "tarpaulin").moved(back_m + trailer_m / 2, 0, 1.2)
    beam = box_mesh((trailer_m - 0.5, 1.0, 0.3), "frame").moved(back_m + trailer_m / 2, 0, 0.9)
    tractor = box_mesh((5.4, 0.9, 0.4), "frame").moved(front_m - 3.2, 0, 0.55)
    guard = box_mesh((5.6, 0.05, 0.45), "frame")
    guards = [guard.moved(back_m + 0.6 * trailer_m, s * (width_m / 2 - 0.08), 0.5) for s in (-1, 1)]
    axles = [front_m - 1.4, front_m - 5.0, back_m + 4.7, back_m + 3.4, back_m + 2.1]
    tape = box_mesh((trailer_m - 0.2, width_m + 0.01, TAPE_M), "plate")
    parts = [load, beam, tractor, *guards, tape.moved(back_m + trailer_m / 2, 0, 1.22)]
    cab = _cab(front_m, 2.25, 0.98 * width_m, 0.93 * height_m, paint, pose)
    return merge([*parts, *cab, *_wheels(axles, width_m), *_rear(length_m, width_m, height_m)])


def _wheels(axles_m: list[float], width_m: float) -> list[Mesh]:
    return [wheel(x, s * (width_m / 2 - 0.05), 0.5, 0.3, sides=10) for x in axles_m for s in (-1, 1)]


def _rear(length_m: float, width_m: float, height_m: float) -> list[Mesh]:
    """Underrun bar, plate, lamps and the tape that outlines the doors."""
    x_m = -length_m / 2
    lamp, post = box_mesh((0.06, 0.35, 0.14), "lamp"), box_mesh((0.01, TAPE_M, height_m - 1.5), "plate")
    bar = box_mesh((0.1, 0.94 * width_m, 0.14), "frame")
    parts = [bar.moved(x_m + 0.15, 0, 0.45), box_mesh((0.02, 0.52, 0.11), "plate").moved(x_m + 0.08, 0, 0.62)]
    for side in (-1, 1):
        parts.append(lamp.moved(x_m + 0.06, side * 0.38 * width_m, 0.75))
        parts.append(post.moved(x_m, side * (width_m / 2 - 0.08), 1.3))
    return parts


def _cab(
    front_m: float, long_m: float, width_m: float, height_m: float, paint: str, pose: float
) -> list[Mesh]:
    """A cab over the engine: windscreen and door windows of glass, two seats behind them."""
    floor_m, back_m = 0.45, front_m - long_m
    belt_m = 0.53 * height_m if height_m < 3 else 1.75
    top_m = min(height_m, belt_m + 0.95)
    half = [width_m / 2] * 6
    hull = [(back_m, height_m), (back_m, floor_m), (front_m, floor_m), (front_m, belt_m)]
    shield = [(front_m - 0.12, top_m), (front_m - 0.3, height_m)]
    # From the rear wall's top around below to the windscreen, and back over the roof.
    outline = [*hull, *shield, hull[0]]
    arch = shapely.Point(front_m - 1.35, 0.5).buffer(0.6, quad_segs=3)
    side = shapely.Polygon(outline) - arch
    window = shapely.box(front_m - 1.25, belt_m + 0.05, front_m - 0.3, top_m - 0.12)
    dash = box_mesh((0.4, 0.9 * width_m, 0.3), "interior").moved(front_m - 0.35, 0, belt_m - 0.3)
    floor = box_mesh((long_m - 0.1, 0.9 * width_m, 0.02), "interior").moved(
        front_m - long_m / 2, 0, belt_m - 0.62
    )
    x_m = front_m - 1.0
    seats = [part for s in (-1, 1) for part in _seat(x_m, s * 0.28 * width_m, 0.5, belt_m, True)]
    people = [1, -1] if pose > 0.6 else [1]
    lamp = box_mesh((0.08, 0.4, 0.18), "lamp")
    return [
        panels(side - window, lambda points: np.full(len(points), width_m / 2), paint),
        panels(window, lambda points: np.full(len(points), width_m / 2), "glass"),
        band(outline, [*half, half[0]], [paint, "plastic", paint, "glass", paint, paint]),
        dash,
        floor,
        *seats,
        *(part for s in people for part in _sitting(x_m, s * 0.28 * width_m, belt_m)),
        *(lamp.moved(front_m - 0.03, s * 0.36 * width_m, 0.65) for s in (-1, 1)),
        box_mesh((0.02, 0.52, 0.11), "plate").moved(front_m, 0, 0.5),
    ]
