"""Bodies of road users: their properties for traffic, labels and radios. Their meshes belong to the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.scenario.traffic import UserBody
from advpipe.pipeline.v2x.codec.codes import StationType, TrailerPresence
from advpipe.stages.simulate.mesh_file import read_mesh_file


@dataclass(frozen=True)
class Body:
    """A type of road user; it fills a box of length x width x height that stands on the ground.

    label: its class in the ground truth. Side mirrors stick out of the box. station_type: of its ITS station;
    None if it carries no radio. trailer: what its CAMs report of a trailer.
    """

    name: str
    label: str
    length_m: float
    width_m: float
    height_m: float
    max_speed_mps: float
    acceleration_mps2: float
    station_type: StationType | None = None
    trailer: TrailerPresence = TrailerPresence.NONE


BODIES = {
    body.name: body
    for body in (
        Body("sedan", "car", 4.75, 1.83, 1.45, 50.0, 2.6, StationType.PASSENGER_CAR),
        Body("hatchback", "car", 4.05, 1.76, 1.5, 50.0, 2.6, StationType.PASSENGER_CAR),
        Body("estate", "car", 4.75, 1.83, 1.48, 50.0, 2.6, StationType.PASSENGER_CAR),
        Body("suv", "car", 4.7, 1.92, 1.72, 50.0, 2.6, StationType.PASSENGER_CAR),
        Body("pickup", "car", 5.3, 1.98, 1.85, 50.0, 2.4, StationType.PASSENGER_CAR),
        Body("van", "truck", 5.4, 2.05, 2.3, 40.0, 2.0, StationType.LIGHT_TRUCK),
        Body("minibus", "truck", 6.0, 2.02, 2.65, 36.0, 1.8, StationType.LIGHT_TRUCK),
        Body("box_truck", "truck", 8.2, 2.5, 3.3, 28.0, 1.3, StationType.HEAVY_TRUCK),
        Body(
            *("semi_trailer", "truck", 16.5, 2.55, 4.0, 25.0, 0.9, StationType.HEAVY_TRUCK),
            trailer=TrailerPresence.KNOWN_LENGTH,
        ),
        Body("bus", "truck", 11.9, 2.55, 3.1, 25.0, 1.2, StationType.BUS),
        Body("motorcycle", "cyclist", 2.15, 0.8, 1.6, 45.0, 3.5, StationType.MOTORCYCLE),
        Body("scooter", "cyclist", 1.85, 0.7, 1.65, 22.0, 2.5, StationType.MOPED),
        Body("bicycle", "cyclist", 1.8, 0.62, 1.75, 5.5, 1.2),
        Body("pedestrian", "pedestrian", 0.65, 0.6, 1.72, 1.5, 1.0),
        Body("pedestrian_backpack", "pedestrian", 0.72, 0.6, 1.75, 1.5, 1.0),
        Body("pedestrian_suitcase", "pedestrian", 1.1, 0.62, 1.7, 1.4, 1.0),
        Body("pedestrian_umbrella", "pedestrian", 1.0, 1.0, 2.05, 1.4, 1.0),
        Body("child", "pedestrian", 0.5, 0.44, 1.2, 1.3, 1.0),
    )
}
"""Every body by name; `traffic.mix` and `vehicles.*.body` use those that drive on the road.

Sizes are those of common models: small cars of 4.05 m to the European limits of 16.5 x 2.55 x 4 m.
"""

_STATION_TYPES = {"car": StationType.PASSENGER_CAR, "truck": StationType.HEAVY_TRUCK}
"""Station type of a user-supplied body by its class in the scenario; other classes carry no radio."""

PAINTS = (
    "paint_black",
    "paint_grey",
    "paint_blue",
    "paint_green",
    "paint_red",
    "paint_silver",
    "paint_yellow",
    "paint_white",
)

LARGEST_M = np.array([16.5, 2.6, 4.0])
"""Legal limits of length, width and height on the road (directive 96/53/EC)."""

VARIANTS = 6


@dataclass(frozen=True)
class Variant:
    """One of a few sizes and colours that a body comes in; its name is like `sedan.3`.

    paint: the material of its surface. pose: in [0, 1], posture of its occupants, its rider or the
    pedestrian.
    """

    name: str
    body: Body
    length_m: float
    width_m: float
    height_m: float
    paint: str
    pose: float = 0.5


def draw_variants(
    rng: np.random.Generator, user_bodies: Mapping[str, UserBody] | None = None
) -> dict[str, Variant]:
    """Variants by name: `VARIANTS` of each body, with sizes within 7 % of the body's, and one of each user
    body.

    Raises AdvpipeError for an unusable mesh file of the user.
    """
    variants = {}
    for body in BODIES.values():
        for index in range(VARIANTS):
            factors = np.clip(rng.normal(1.0, 0.03, size=3), 0.93, 1.07)
            size = np.minimum(np.array([body.length_m, body.width_m, body.height_m]) * factors, LARGEST_M)
            length_m, width_m, height_m = (round(float(side), 2) for side in size)
            paint, pose = PAINTS[int(rng.integers(len(PAINTS)))], float(rng.random())
            name = f"{body.name}.{index}"
            variants[name] = Variant(name, body, length_m, width_m, height_m, paint, pose)
    for name, user_body in (user_bodies or {}).items():
        variants[f"{name}.0"] = _user_variant(name, user_body)
    return variants


def variants_of(variants: Mapping[str, Variant], body: str) -> list[str]:
    """Names of the variants of a body, in order."""
    return [name for name, variant in variants.items() if variant.body.name == body]


def _user_variant(name: str, user_body: UserBody) -> Variant:
    """The variant of a user-supplied body, as large as its mesh."""
    vertices_m, _ = read_mesh_file(user_body.mesh, f"bodies.{name}", user_body.scale)
    length_m, width_m, height_m = (float(side) for side in np.ptp(vertices_m, axis=0))
    body = Body(
        name,
        user_body.label,
        length_m,
        width_m,
        height_m,
        user_body.max_speed_mps,
        user_body.acceleration_mps2,
        _STATION_TYPES.get(user_body.label),
    )
    return Variant(f"{name}.0", body, length_m, width_m, height_m, user_body.material)
