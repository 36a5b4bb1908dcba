"""Bodies of road users: what they measure, how SUMO drives them, and their meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from advpipe.stages.simulate.world.mesh import Mesh, box, ellipsoid, extruded_profile, merge, tube

Profile = list[tuple[float, float]]
WHEEL_RADIUS_M = 0.32


@dataclass(frozen=True)
class Body:
    """A kind of road user; the mesh fills length x width x height exactly, standing on z = 0."""

    label: str
    length_m: float
    width_m: float
    height_m: float
    max_speed_mps: float
    acceleration_mps2: float
    build: Callable[[float, float, float, str], Mesh]

    def mesh(self, length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
        """The mesh in base_link: x forward, origin on the ground below the box's centre."""
        mesh = self.build(length_m, width_m, height_m, paint)
        low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
        scale = np.array([length_m, width_m, height_m]) / (high - low)
        centred = mesh.moved(-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2])
        return centred.scaled(scale[0], scale[1], scale[2])


def _car(lower: Profile, cabin: Profile, roof: float) -> Callable[[float, float, float, str], Mesh]:
    """A car from two side views in parts of length and height; the cabin narrows to `roof` at the top."""

    def build(length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
        def to_metres(profile: Profile) -> Profile:
            return [(x * length_m, z * height_m) for x, z in profile]

        top = max(z for _, z in cabin)
        bottom = min(z for _, z in cabin)
        lower_half = [width_m / 2 * (0.9 if abs(x) > 0.46 else 1.0) for x, _ in lower]
        cabin_half = [width_m / 2 * (0.95 - (0.95 - roof) * (z - bottom) / (top - bottom)) for _, z in cabin]
        flat = [abs(b[1] - a[1]) < 0.1 for a, b in zip(cabin, [*cabin[1:], cabin[0]], strict=True)]
        rim = [paint if is_flat else "glass" for is_flat in flat]
        plate = box((0.02, 0.5, 0.11), "plate")
        return merge(
            [
                extruded_profile(to_metres(lower), lower_half, paint, paint),
                extruded_profile(to_metres(cabin), cabin_half, "glass", rim),
                plate.moved(-length_m / 2 - 0.01, 0, 0.45),
                plate.moved(length_m / 2 + 0.01, 0, 0.4),
                *_wheels(0.3 * length_m, width_m, WHEEL_RADIUS_M, 0.22),
            ]
        )

    return build


def _wheels(axle_x_m: float, width_m: float, radius_m: float, tread_m: float) -> list[Mesh]:
    half = width_m / 2 - 0.01
    return [
        tube((x, side * (half - tread_m), radius_m), (x, side * half, radius_m), radius_m, "rubber", 12)
        for x in (-axle_x_m, axle_x_m)
        for side in (-1, 1)
    ]


def _pickup(length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
    lower: Profile = [
        (-0.5, 0.3),
        (-0.5, 0.58),
        (0.2, 0.6),
        (0.47, 0.56),
        (0.5, 0.45),
        (0.5, 0.22),
        (-0.45, 0.2),
    ]
    cabin: Profile = [(-0.12, 0.58), (-0.08, 0.98), (0.06, 1.0), (0.2, 0.6)]
    return _car(lower, cabin, 0.8)(length_m, width_m, height_m, paint)


def _box_truck(length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
    cab_length = 1.9
    cab_height = min(2.5, 0.78 * height_m)
    half = [width_m / 2 * 0.95] * 5
    front = length_m / 2
    cab: Profile = [
        (front - cab_length, 0.5),
        (front - cab_length, cab_height),
        (front - 0.35, cab_height),
        (front - 0.05, 0.55 * cab_height),
        (front, 0.5),
    ]
    load = box((length_m - cab_length - 0.25, width_m, height_m - 0.95), "plaster")
    chassis = box((length_m - 0.5, 0.9, 0.35), "steel")
    wheels = _wheels(0.34 * length_m, width_m * 0.96, 0.48, 0.3)
    return merge(
        [
            extruded_profile(cab, half, paint, [paint, paint, "glass", paint, paint]),
            load.moved(-(cab_length + 0.25) / 2, 0, 0.95),
            chassis.moved(-0.2, 0, 0.55),
            *wheels,
        ]
    )


def _bus(length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
    lower = box((length_m, width_m, 1.15 - 0.3), paint)
    windows = box((length_m - 0.15, width_m - 0.06, height_m - 1.15 - 0.35), "glass")
    roof = box((length_m - 0.05, width_m - 0.02, 0.35), paint)
    return merge(
        [
            lower.moved(0, 0, 0.3),
            windows.moved(0, 0, 1.15),
            roof.moved(0, 0, height_m - 0.35),
            *_wheels(0.29 * length_m, width_m, 0.48, 0.3),
        ]
    )


def _person(height_m: float, stride_m: float) -> Mesh:
    hip, shoulder = 0.5 * height_m, 0.82 * height_m
    legs = [
        tube((side * stride_m / 2, 0.09 * side, 0.0), (0, 0.09 * side, hip), 0.07, "cloth", 6)
        for side in (-1, 1)
    ]
    arms = [
        tube((0, 0.24 * side, shoulder), (-side * stride_m / 3, 0.27 * side, hip), 0.045, "cloth", 6)
        for side in (-1, 1)
    ]
    torso = ellipsoid((0, 0, (hip + shoulder) / 2), (0.13, 0.21, (shoulder - hip) / 2 + 0.06), "cloth")
    head = ellipsoid((0.01, 0, 0.93 * height_m), (0.1, 0.08, 0.07 * height_m), "skin", 4)
    return merge([*legs, *arms, torso, head])


def _pedestrian(length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
    return _person(height_m, 0.45)


def _rider(seat_m: float, height_m: float, lean_m: float) -> Mesh:
    """Somebody who sits: legs down to the pedals, hands forward."""
    shoulder = height_m - 0.32
    legs = [tube((0.22, 0.11 * s, 0.3), (-0.12, 0.1 * s, seat_m), 0.08, "cloth", 6) for s in (-1, 1)]
    arms = [
        tube((lean_m, 0.2 * s, shoulder), (0.45, 0.22 * s, seat_m + 0.15), 0.05, "cloth", 6) for s in (-1, 1)
    ]
    spine = tube((-0.12, 0, seat_m), (lean_m, 0, shoulder + 0.05), 0.17, "cloth", 8)
    head = ellipsoid((lean_m + 0.05, 0, height_m - 0.13), (0.12, 0.1, 0.13), "plastic", 4)
    return merge([*legs, *arms, spine, head])


def _two_wheeler(radius_m: float, tyre_m: float, seat_m: float, tank: str | None) -> Callable[..., Mesh]:
    def build(length_m: float, width_m: float, height_m: float, paint: str) -> Mesh:
        axle = length_m / 2 - radius_m
        wheels = [
            tube((x, -tyre_m, radius_m), (x, tyre_m, radius_m), radius_m, "rubber", 14) for x in (-axle, axle)
        ]
        frame = [
            tube((-axle, 0, radius_m), (0.1, 0, seat_m * 0.85), 0.04, "steel", 5),
            tube((axle, 0, radius_m), (axle - 0.2, 0, seat_m + 0.2), 0.04, "steel", 5),
            tube((-0.1, 0, seat_m * 0.9), (axle - 0.2, 0, seat_m), 0.04, "steel", 5),
            tube(
                (axle - 0.2, -width_m / 2, seat_m + 0.2),
                (axle - 0.2, width_m / 2, seat_m + 0.2),
                0.025,
                "steel",
                5,
            ),
        ]
        hull = [ellipsoid((0.1, 0, seat_m * 0.75), (0.55, 0.18, 0.24), paint)] if tank else []
        return merge([*wheels, *frame, *hull, _rider(seat_m, height_m, 0.18)])

    return build


SEDAN = _car(
    [(-0.5, 0.3), (-0.5, 0.6), (-0.46, 0.66), (-0.3, 0.68), (0.2, 0.65), (0.44, 0.54), (0.5, 0.44),
     (0.5, 0.2), (-0.44, 0.16)],
    [(-0.4, 0.65), (-0.22, 0.97), (-0.02, 1.0), (0.06, 0.98), (0.25, 0.64)],
    0.74,
)  # fmt: skip
HATCHBACK = _car(
    [(-0.5, 0.28), (-0.5, 0.62), (0.22, 0.64), (0.44, 0.54), (0.5, 0.42), (0.5, 0.18), (-0.44, 0.15)],
    [(-0.49, 0.62), (-0.4, 0.95), (-0.1, 1.0), (0.06, 0.98), (0.28, 0.63)],
    0.76,
)
SUV = _car(
    [(-0.5, 0.3), (-0.5, 0.62), (0.22, 0.63), (0.46, 0.56), (0.5, 0.46), (0.5, 0.22), (-0.45, 0.2)],
    [(-0.49, 0.6), (-0.43, 0.97), (-0.05, 1.0), (0.08, 0.98), (0.24, 0.62)],
    0.82,
)
VAN = _car(
    [(-0.5, 0.2), (-0.5, 0.5), (0.3, 0.52), (0.46, 0.46), (0.5, 0.38), (0.5, 0.16), (-0.46, 0.13)],
    [(-0.5, 0.5), (-0.49, 0.99), (0.2, 1.0), (0.28, 0.97), (0.42, 0.48)],
    0.88,
)

BODIES = {
    "sedan": Body("car", 4.75, 1.83, 1.45, 50.0, 2.6, SEDAN),
    "hatchback": Body("car", 4.05, 1.76, 1.5, 50.0, 2.6, HATCHBACK),
    "suv": Body("car", 4.7, 1.92, 1.72, 50.0, 2.6, SUV),
    "pickup": Body("car", 5.3, 1.98, 1.85, 50.0, 2.4, _pickup),
    "van": Body("truck", 5.4, 2.05, 2.3, 40.0, 2.0, VAN),
    "box_truck": Body("truck", 8.2, 2.5, 3.3, 28.0, 1.3, _box_truck),
    "bus": Body("truck", 11.9, 2.55, 3.1, 25.0, 1.2, _bus),
    "motorcycle": Body("cyclist", 2.15, 0.8, 1.6, 45.0, 3.5, _two_wheeler(0.31, 0.07, 0.78, "tank")),
    "bicycle": Body("cyclist", 1.8, 0.62, 1.75, 5.5, 1.2, _two_wheeler(0.34, 0.02, 0.95, None)),
    "pedestrian": Body("pedestrian", 0.6, 0.6, 1.72, 1.5, 1.0, _pedestrian),
}
"""Every body by name; `traffic.mix` and `vehicles.*.body` use these names."""

VARIANTS = 6


@dataclass(frozen=True)
class Variant:
    """One of a few sizes and colours that a body comes in; its name is like `sedan.3`."""

    name: str
    body: Body
    length_m: float
    width_m: float
    height_m: float
    mesh: Mesh


def draw_variants(rng: np.random.Generator) -> dict[str, Variant]:
    """`VARIANTS` of each body, sizes within about 6 % of the body's, by name."""
    from advpipe.stages.simulate.world.materials import PAINTS

    variants = {}
    for body_name, body in BODIES.items():
        for index in range(VARIANTS):
            factors = np.clip(rng.normal(1.0, 0.03, size=3), 0.93, 1.07)
            size = np.array([body.length_m, body.width_m, body.height_m]) * factors
            length_m, width_m, height_m = (round(float(side), 2) for side in size)
            paint = PAINTS[int(rng.integers(len(PAINTS)))]
            name = f"{body_name}.{index}"
            mesh = body.mesh(length_m, width_m, height_m, paint)
            variants[name] = Variant(name, body, length_m, width_m, height_m, mesh)
    return variants
