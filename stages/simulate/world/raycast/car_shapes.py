"""The shapes of cars, vans and buses: their side views, windows, seats and wheels."""

from __future__ import annotations

from advpipe.stages.simulate.world.raycast.cars import CarShape
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge

CITY_CAR = CarShape(
    rear=[(-0.5, 0.2), (-0.5, 0.58)],
    cabin=[(-0.49, 0.61), (-0.45, 0.9), (-0.38, 0.97), (-0.05, 1.0), (0.1, 0.97), (0.34, 0.62)],
    front=[(0.46, 0.54), (0.495, 0.44), (0.5, 0.18)],
    roof=0.79, pillars=(-0.08,), rows=(0.05, -0.2), axles=(-0.33, 0.34), wheel_radius_m=0.28,
)  # fmt: skip
SUPERMINI = CarShape(
    rear=[(-0.5, 0.19), (-0.5, 0.58)],
    cabin=[(-0.49, 0.62), (-0.43, 0.93), (-0.36, 0.98), (-0.06, 1.0), (0.07, 0.975), (0.29, 0.63)],
    front=[(0.45, 0.54), (0.493, 0.45), (0.5, 0.18)],
    roof=0.77, pillars=(-0.04, -0.29), rows=(0.05, -0.18), axles=(-0.32, 0.33), wheel_radius_m=0.3,
)  # fmt: skip
SEDAN = CarShape(
    rear=[(-0.5, 0.2), (-0.5, 0.6), (-0.47, 0.68)],
    cabin=[(-0.37, 0.68), (-0.22, 0.96), (-0.08, 1.0), (0.04, 0.98), (0.22, 0.65)],
    front=[(0.42, 0.57), (0.49, 0.48), (0.5, 0.2)],
    roof=0.74, pillars=(-0.05, -0.24), rows=(0.04, -0.15),
)  # fmt: skip
HATCHBACK = CarShape(
    rear=[(-0.5, 0.2), (-0.5, 0.6)],
    cabin=[(-0.49, 0.62), (-0.41, 0.95), (-0.1, 1.0), (0.05, 0.98), (0.26, 0.63)],
    front=[(0.43, 0.55), (0.49, 0.47), (0.5, 0.18)],
    roof=0.76, pillars=(-0.04, -0.28), rows=(0.05, -0.18), axles=(-0.31, 0.32),
)  # fmt: skip
ESTATE = CarShape(
    rear=[(-0.5, 0.2), (-0.5, 0.6)],
    cabin=[(-0.49, 0.63), (-0.44, 0.94), (-0.1, 1.0), (0.05, 0.98), (0.23, 0.64)],
    front=[(0.42, 0.57), (0.49, 0.48), (0.5, 0.19)],
    roof=0.75, pillars=(-0.04, -0.23), rows=(0.04, -0.15), tinted_to=-0.25,
)  # fmt: skip
EXECUTIVE = CarShape(
    rear=[(-0.5, 0.19), (-0.5, 0.6), (-0.47, 0.68)],
    cabin=[(-0.38, 0.68), (-0.2, 0.95), (-0.08, 1.0), (0.03, 0.98), (0.2, 0.65)],
    front=[(0.43, 0.57), (0.49, 0.48), (0.5, 0.19)],
    roof=0.74, pillars=(-0.05, -0.23), rows=(0.04, -0.15), wheel_radius_m=0.34, tinted_to=-0.06,
)  # fmt: skip
COUPE = CarShape(
    rear=[(-0.5, 0.2), (-0.5, 0.62), (-0.47, 0.7)],
    cabin=[(-0.4, 0.71), (-0.22, 0.94), (-0.07, 1.0), (0.03, 0.97), (0.19, 0.66)],
    front=[(0.42, 0.57), (0.49, 0.45), (0.5, 0.18)],
    roof=0.72, pillars=(-0.12,), rows=(0.0, -0.18), axles=(-0.3, 0.31), wheel_radius_m=0.33,
)  # fmt: skip
SMALL_SUV = CarShape(
    rear=[(-0.5, 0.22), (-0.5, 0.6)],
    cabin=[(-0.49, 0.63), (-0.43, 0.93), (-0.36, 0.98), (-0.05, 1.0), (0.07, 0.98), (0.25, 0.64)],
    front=[(0.45, 0.57), (0.49, 0.49), (0.5, 0.21)],
    roof=0.8, pillars=(-0.03, -0.27), rows=(0.05, -0.17), axles=(-0.31, 0.32), wheel_radius_m=0.34,
)  # fmt: skip
MPV = CarShape(
    rear=[(-0.5, 0.18), (-0.5, 0.54)],
    cabin=[(-0.49, 0.57), (-0.45, 0.93), (-0.38, 0.98), (-0.06, 1.0), (0.1, 0.97), (0.34, 0.59)],
    front=[(0.46, 0.51), (0.493, 0.43), (0.5, 0.16)],
    roof=0.82, pillars=(0.2, -0.03, -0.25), rows=(0.06, -0.14, -0.33), axles=(-0.31, 0.33),
    tinted_to=-0.05,
)  # fmt: skip
COMPACT_VAN = CarShape(
    rear=[(-0.5, 0.15), (-0.5, 0.48)],
    cabin=[(-0.495, 0.51), (-0.48, 0.97), (-0.1, 1.0), (0.1, 0.975), (0.3, 0.57)],
    front=[(0.45, 0.5), (0.49, 0.41), (0.5, 0.14)],
    roof=0.88, pillars=(0.17, -0.06, -0.3), rows=(0.06, -0.17), axles=(-0.3, 0.33), wheel_radius_m=0.31,
)  # fmt: skip
SUV = CarShape(
    rear=[(-0.5, 0.22), (-0.5, 0.61)],
    cabin=[(-0.49, 0.62), (-0.43, 0.96), (-0.05, 1.0), (0.07, 0.98), (0.23, 0.63)],
    front=[(0.45, 0.57), (0.49, 0.49), (0.5, 0.22)],
    roof=0.82, pillars=(-0.03, -0.24), rows=(0.05, -0.15), wheel_radius_m=0.37, tinted_to=-0.06,
)  # fmt: skip
PICKUP = CarShape(
    rear=[(-0.5, 0.24), (-0.5, 0.58)],
    cabin=[(-0.13, 0.58), (-0.1, 0.97), (0.02, 1.0), (0.09, 0.98), (0.21, 0.6)],
    front=[(0.46, 0.56), (0.49, 0.47), (0.5, 0.22)],
    roof=0.8, pillars=(0.02,), rows=(0.08, -0.06), wheel_radius_m=0.39, bed=True,
)  # fmt: skip
VAN = CarShape(
    rear=[(-0.5, 0.14), (-0.5, 0.48)],
    cabin=[(-0.5, 0.5), (-0.49, 0.99), (0.2, 1.0), (0.27, 0.97), (0.42, 0.5)],
    front=[(0.47, 0.43), (0.5, 0.36), (0.5, 0.14)],
    roof=0.88, pillars=(0.17,), rows=(0.24,), axles=(-0.3, 0.33), wheel_radius_m=0.34,
    glazed_from=0.18, rear_glass=False,
)  # fmt: skip
MINIBUS = CarShape(
    rear=[(-0.5, 0.14), (-0.5, 0.44)],
    cabin=[(-0.5, 0.46), (-0.49, 0.98), (0.24, 1.0), (0.3, 0.97), (0.43, 0.48)],
    front=[(0.47, 0.4), (0.5, 0.33), (0.5, 0.13)],
    roof=0.9, pillars=(0.22, 0.02, -0.18, -0.36), rows=(0.29, 0.14, -0.02, -0.18, -0.34),
    axles=(-0.28, 0.33), wheel_radius_m=0.35, tinted_to=0.2,
)  # fmt: skip
BUS = CarShape(
    rear=[(-0.5, 0.1), (-0.5, 0.38)],
    cabin=[(-0.5, 0.4), (-0.498, 0.99), (-0.3, 1.0), (0.48, 1.0), (0.498, 0.36)],
    front=[(0.5, 0.3), (0.5, 0.24), (0.5, 0.1)],
    roof=0.98, pillars=(0.4, 0.26, 0.12, -0.02, -0.16, -0.3, -0.42),
    rows=(0.43, 0.3, 0.22, 0.1, 0.02, -0.06, -0.14, -0.3, -0.38, -0.45),
    axles=(-0.24, 0.27), wheel_radius_m=0.48, tinted_to=0.38,
)  # fmt: skip

ROOF_BOX_M = (1.75, 0.75, 0.38)
RAILS_M = 0.04


def estate_with_roof_box(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """An estate with a box on its roof; `height_m` is that of the box's lid."""
    roof_m = height_m - ROOF_BOX_M[2]
    long_m, wide_m, high_m = ROOF_BOX_M
    low = box_mesh((long_m, wide_m, 0.6 * (high_m - RAILS_M)), "plastic")
    lid = box_mesh((0.8 * long_m, 0.86 * wide_m, 0.4 * (high_m - RAILS_M)), "plastic")
    rail = box_mesh((0.04, 0.62 * width_m, RAILS_M + 0.02), "frame")
    box_m = -0.06 * length_m
    parts = [
        ESTATE(length_m, width_m, roof_m, paint, pose),
        low.moved(box_m, 0, roof_m + RAILS_M),
        lid.moved(box_m - 0.05 * long_m, 0, roof_m + RAILS_M + 0.6 * (high_m - RAILS_M)),
        *(rail.moved(box_m + x_m, 0, roof_m - 0.02) for x_m in (-0.45, 0.45)),
    ]
    return merge(parts)
