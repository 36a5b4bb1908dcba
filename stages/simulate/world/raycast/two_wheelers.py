"""Bicycles, motor scooters and motorcycles, each with a rider."""

from __future__ import annotations

import numpy as np

from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, ellipsoid, merge, tube
from advpipe.stages.simulate.world.raycast.people import riding, standing_rider
from advpipe.stages.simulate.world.raycast.shapes import hoop, quad


def bicycle(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """Spoked wheels of 28 inches, a diamond frame; `pose` in [0, 1] is the phase of the pedals, and the rider
    leans by it, from upright to low."""
    radius_m, seat_m = 0.34, 0.95
    axle = length_m / 2 - radius_m
    crank, head, saddle = (-0.02, 0, 0.3), (axle - 0.18, 0, 0.88), (-0.16, 0, seat_m - 0.08)
    pipes = [(crank, head), (crank, saddle), (saddle, head), (crank, (-axle, 0, radius_m))]
    pipes += [(saddle, (-axle, 0, radius_m)), (head, (axle, 0, radius_m))]
    bar = tube(
        (axle - 0.2, -width_m / 2, seat_m + 0.12), (axle - 0.2, width_m / 2, seat_m + 0.12), 0.02, "frame", 5
    )
    reflector = box_mesh((0.02, 0.06, 0.06), "lamp")
    return merge(
        [
            *(hoop((x, 0, radius_m), radius_m, 0.05, 0.02, 16) for x in (-axle, axle)),
            *(tube(a, b, 0.02, paint, 5) for a, b in pipes),
            bar,
            reflector.moved(-axle - 0.1, 0, seat_m - 0.25),
            reflector.moved(axle - 0.1, 0, seat_m - 0.05),
            *riding(seat_m, height_m, 0.04 + 0.26 * (3.7 * pose % 1), axle - 0.2, pose),
        ]
    )


def cargo_bike(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A long bicycle with a box for children or goods between its small front wheel and the handlebar."""
    radius_m, small_m, seat_m = 0.33, 0.25, 0.92
    rear, ahead = -length_m / 2 + radius_m, length_m / 2 - small_m
    crank, head, saddle = (-0.45, 0, 0.3), (-0.02, 0, 0.85), (-0.62, 0, seat_m - 0.08)
    pipes = [(crank, head), (crank, saddle), (saddle, head), (crank, (rear, 0, radius_m))]
    pipes += [(saddle, (rear, 0, radius_m)), (crank, (ahead, 0, small_m))]
    rider = merge(riding(seat_m, height_m, 0.08, 0.5, pose)).moved(-0.46, 0, 0)
    box = box_mesh((0.85, 0.6, 0.5), "wood").moved(0.42, 0, 0.3)
    reflector = box_mesh((0.02, 0.06, 0.06), "lamp")
    return merge(
        [
            hoop((rear, 0, radius_m), radius_m, 0.05, 0.02, 16),
            hoop((ahead, 0, small_m), small_m, 0.05, 0.02, 14),
            *(tube(a, b, 0.025, paint, 5) for a, b in pipes),
            tube((0.0, -width_m / 2, seat_m + 0.14), (0.0, width_m / 2, seat_m + 0.14), 0.02, "frame", 5),
            box,
            reflector.moved(rear - 0.1, 0, seat_m - 0.25),
            rider,
        ]
    )


def kick_scooter(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """An electric kick scooter; its rider stands on the deck."""
    radius_m, deck_m = 0.11, 0.16
    axle, bar_m = length_m / 2 - radius_m, 1.15
    grip = (axle - 0.12, bar_m)
    return merge(
        [
            *(tube((x, -0.03, radius_m), (x, 0.03, radius_m), radius_m, "rubber", 10) for x in (-axle, axle)),
            box_mesh((2 * axle - 0.15, 0.16, 0.06), "frame").moved(-0.02, 0, deck_m - 0.06),
            tube((axle, 0, radius_m), (grip[0], 0, bar_m), 0.03, "frame", 6),
            tube((grip[0], -width_m / 2, bar_m), (grip[0], width_m / 2, bar_m), 0.02, "frame", 5),
            box_mesh((0.02, 0.06, 0.06), "lamp").moved(-axle - 0.1, 0, 0.25),
            *standing_rider(height_m, deck_m, grip),
        ]
    )


def scooter(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A motor scooter: small wheels, leg shield, footboard, a seat over the engine."""
    radius_m, seat_m = 0.24, 0.78
    axle = length_m / 2 - radius_m
    ahead = axle - 0.22
    shield = [(ahead, -0.2, 0.3), (ahead, 0.2, 0.3), (ahead - 0.12, 0.16, 0.95), (ahead - 0.12, -0.16, 0.95)]
    return merge(
        [
            *(tube((x, -0.05, radius_m), (x, 0.05, radius_m), radius_m, "rubber", 12) for x in (-axle, axle)),
            box_mesh((0.95 * axle, 0.28, 0.4), paint).moved(-0.55 * axle, 0, 0.3),
            box_mesh((0.6, 0.28, 0.1), "plastic").moved(-0.4 * axle, 0, seat_m - 0.1),
            box_mesh((axle, 0.32, 0.06), paint).moved(0.3 * axle, 0, 0.27),
            quad(shield, paint),
            *_steering(axle, radius_m, ahead - 0.12, 1.0, width_m),
            box_mesh((0.02, 0.2, 0.2), "plate").moved(-axle - 0.15, 0, 0.5),
            box_mesh((0.08, 0.2, 0.1), "lamp").moved(-axle - 0.05, 0, 0.62),
            *riding(seat_m, height_m, 0.02, ahead - 0.15, 0.5),
        ]
    )


def motorcycle(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A road motorcycle with tank, engine block and exhaust."""
    radius_m, seat_m = 0.31, 0.8
    axle = length_m / 2 - radius_m
    return merge(
        [
            *(tube((x, -0.07, radius_m), (x, 0.07, radius_m), radius_m, "rubber", 14) for x in (-axle, axle)),
            ellipsoid((0.16, 0, seat_m + 0.02), (0.32, 0.16, 0.17), paint, 4),
            box_mesh((0.5, 0.32, 0.4), "frame").moved(0.1, 0, 0.25),
            box_mesh((0.75, 0.26, 0.12), "plastic").moved(-0.4, 0, seat_m - 0.1),
            tube((0.1, -0.2, 0.3), (-0.75, -0.22, 0.42), 0.055, "frame", 6),
            tube((-axle, 0, radius_m), (-0.1, 0, 0.5), 0.05, "frame", 5),
            *_steering(axle, radius_m, axle - 0.3, seat_m + 0.2, width_m),
            box_mesh((0.02, 0.2, 0.22), "plate").moved(-axle - 0.22, 0, 0.52),
            box_mesh((0.06, 0.2, 0.08), "lamp").moved(-axle - 0.15, 0, 0.74),
            *riding(seat_m, height_m, 0.12, axle - 0.32, 0.5),
        ]
    )


def _steering(axle: float, radius_m: float, x_m: float, z_m: float, width_m: float) -> list[Mesh]:
    """Fork, handlebar, mirrors and head-lamp."""
    mirrors = [
        quad(
            np.array([[0, -0.06, 0], [0, 0.06, 0], [0, 0.06, 0.09], [0, -0.06, 0.09]])
            + (x_m, s * 0.4 * width_m, z_m + 0.12),
            "plastic",
        )
        for s in (-1, 1)
    ]
    return [
        tube((axle, 0, radius_m), (x_m, 0, z_m), 0.05, "frame", 6),
        tube((x_m, -width_m / 2, z_m), (x_m, width_m / 2, z_m), 0.02, "frame", 5),
        box_mesh((0.1, 0.16, 0.16), "lamp").moved(x_m + 0.1, 0, z_m - 0.16),
        *mirrors,
    ]
