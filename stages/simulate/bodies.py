"""Bodies of road users: their properties for traffic, labels and radios. Their meshes belong to the world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.traffic import UserBody
from advpipe.pipeline.v2x.codec.codes import StationType, TrailerPresence
from advpipe.stages.simulate.mesh_file import read_mesh_file


@dataclass(frozen=True)
class Body:
    """A type of road user; it fills a box of length x width x height that stands on the ground.

    label: its class in the ground truth. Side mirrors stick out of the box. station_type: of its ITS station;
    None if it carries no radio. trailer: what its CAMs report of a trailer. spread: how far variants' length,
    width and height are from the body's, as shares of it. still: a person who stays in one place.
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
    spread: tuple[float, float, float] = (0.04, 0.02, 0.03)
    still: bool = False


def _car(
    name: str, length_m: float, width_m: float, height_m: float, spread: tuple[float, float, float]
) -> Body:
    return Body(name, "car", length_m, width_m, height_m, 50.0, 2.6, StationType.PASSENGER_CAR, spread=spread)


def _person(
    name: str, length_m: float, width_m: float, height_m: float, *, still: bool = False, length: float = 0.2
) -> Body:
    spread = (length, 0.1, 0.08)
    return Body(name, "pedestrian", length_m, width_m, height_m, 1.5, 1.0, spread=spread, still=still)


_HEAVY, _VAN = StationType.HEAVY_TRUCK, StationType.LIGHT_TRUCK

BODIES = {
    body.name: body
    for body in (
        _car("city_car", 3.46, 1.6, 1.49, (0.075, 0.025, 0.035)),
        _car("supermini", 3.9, 1.69, 1.47, (0.05, 0.02, 0.035)),
        _car("hatchback", 4.22, 1.77, 1.47, (0.045, 0.02, 0.03)),
        _car("sedan", 4.64, 1.8, 1.44, (0.045, 0.02, 0.025)),
        _car("estate", 4.68, 1.8, 1.47, (0.045, 0.02, 0.025)),
        _car("estate_roof_box", 4.68, 1.8, 1.87, (0.045, 0.02, 0.025)),
        _car("executive", 4.93, 1.88, 1.47, (0.04, 0.02, 0.025)),
        _car("small_suv", 4.15, 1.77, 1.62, (0.045, 0.025, 0.035)),
        _car("suv", 4.6, 1.88, 1.7, (0.06, 0.025, 0.04)),
        _car("coupe", 4.3, 1.79, 1.34, (0.06, 0.025, 0.04)),
        _car("mpv", 4.4, 1.79, 1.65, (0.08, 0.02, 0.05)),
        _car("compact_van", 4.35, 1.79, 1.83, (0.05, 0.02, 0.03)),
        _car("pickup", 5.2, 1.85, 1.8, (0.04, 0.03, 0.03)),
        Body("van", "truck", 5.4, 2.02, 2.35, 40.0, 2.0, _VAN, spread=(0.12, 0.015, 0.12)),
        Body("minibus", "truck", 6.0, 2.02, 2.65, 36.0, 1.8, _VAN, spread=(0.12, 0.015, 0.06)),
        Body("box_truck", "truck", 8.2, 2.45, 3.35, 28.0, 1.3, _HEAVY, spread=(0.25, 0.03, 0.12)),
        Body("tipper", "truck", 7.4, 2.48, 3.0, 28.0, 1.3, _HEAVY, spread=(0.15, 0.02, 0.06)),
        Body(
            *("semi_trailer", "truck", 15.6, 2.55, 3.9, 25.0, 0.9, _HEAVY, TrailerPresence.KNOWN_LENGTH),
            spread=(0.08, 0.01, 0.05),
        ),
        Body("bus", "truck", 11.6, 2.55, 3.1, 25.0, 1.2, StationType.BUS, spread=(0.12, 0.005, 0.04)),
        Body(
            *("motorcycle", "cyclist", 2.12, 0.8, 1.6, 45.0, 3.5, StationType.MOTORCYCLE),
            spread=(0.07, 0.1, 0.06),
        ),
        Body("scooter", "cyclist", 1.85, 0.7, 1.65, 22.0, 2.5, StationType.MOPED, spread=(0.07, 0.08, 0.06)),
        Body("bicycle", "cyclist", 1.78, 0.61, 1.73, 5.5, 1.2, spread=(0.07, 0.12, 0.07)),
        Body("cargo_bike", "cyclist", 2.5, 0.75, 1.72, 5.0, 1.0, spread=(0.07, 0.12, 0.06)),
        Body("kick_scooter", "cyclist", 1.15, 0.55, 1.85, 5.5, 1.5, spread=(0.05, 0.08, 0.06)),
        _person("pedestrian", 0.7, 0.6, 1.72),
        _person("pedestrian_backpack", 0.75, 0.6, 1.74),
        _person("pedestrian_suitcase", 1.1, 0.62, 1.7, length=0.1),
        _person("pedestrian_umbrella", 1.0, 1.0, 2.05, length=0.1),
        _person("pedestrian_pushchair", 1.55, 0.58, 1.7, length=0.08),
        Body("child", "pedestrian", 0.5, 0.44, 1.2, 1.3, 1.0, spread=(0.2, 0.1, 0.18)),
        _person("pedestrian_standing", 0.42, 0.56, 1.72, still=True),
        _person("pedestrian_sitting", 0.86, 0.56, 1.3, still=True, length=0.08),
        _person("pedestrian_bending", 0.98, 0.55, 1.22, still=True, length=0.08),
    )
}
"""Every body by name; `traffic.mix` and `vehicles.*.body` use those that drive on the road.

Sizes are those of common models of each segment: cars of 3.2 to 5.4 m, trucks up to the European limits of
16.5 x 2.55 x 4 m.
"""

_STATION_TYPES = {"car": StationType.PASSENGER_CAR, "truck": StationType.HEAVY_TRUCK}
"""Station type of a user-supplied body by its class in the scenario; other classes carry no radio."""

PAINTS = {
    "paint_black": 0.26,
    "paint_grey": 0.20,
    "paint_blue": 0.10,
    "paint_green": 0.03,
    "paint_brown": 0.02,
    "paint_red": 0.05,
    "paint_silver": 0.12,
    "paint_yellow": 0.01,
    "paint_white": 0.21,
}
"""Share of each colour among cars: registrations of January to October 2023 in Germany (Kraftfahrt-Bundesamt:
grey with silver 32 %, black 26, white 21, blue 10, red 5, green 3). How grey divides is our estimate."""

TRUCK_PAINTS = PAINTS | {"paint_white": 1.0}
"""The same among vans, trucks and buses, most of which are white; our estimate."""

LARGEST_M = np.array([16.5, 2.6, 4.0])
"""Legal limits of length, width and height on the road (directive 96/53/EC)."""

VARIANTS = 6

WIDER = 0.4
"""From a city car of 3.46 x 1.6 m to a large saloon of 4.93 x 1.88 m, width grows by .4 of the share by which
length does."""


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
    """Variants by name: `VARIANTS` of each body, and one of each user body.

    Lengths and colours are drawn in strata, one variant in each, so that a few variants cover their ranges.

    Raises AdvpipeError for an unusable mesh file of the user.
    """
    variants = {}
    for body in BODIES.values():
        paints = TRUCK_PAINTS if body.label == "truck" else PAINTS
        bounds = np.cumsum(list(paints.values())) / sum(paints.values())
        chosen = np.searchsorted(bounds, _strata(rng), side="right")
        for index, (longer, colour) in enumerate(zip(_strata(rng), chosen, strict=True)):
            size = _size_m(body, 2 * longer - 1, rng)
            paint, pose = list(paints)[min(int(colour), len(paints) - 1)], float(rng.random())
            name = f"{body.name}.{index}"
            variants[name] = Variant(name, body, *size, paint, pose)
    for name, user_body in (user_bodies or {}).items():
        variants[f"{name}.0"] = _user_variant(name, user_body)
    return variants


def _strata(rng: np.random.Generator) -> Float64:
    """Numbers (VARIANTS,) in [0, 1) in any order, one in each of as many equal pieces."""
    places: Float64 = (rng.permutation(VARIANTS) + rng.random(VARIANTS)) / VARIANTS
    return places


def _size_m(body: Body, longer: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Length, width and height; `longer` in [-1, 1] places the length within the body's spread.

    Of two cars of a segment, the longer is wider, too, by `WIDER` of the share; height is drawn by itself.
    """
    shares = np.array(body.spread) * [longer, *rng.uniform(-1, 1, 2)]
    if body.label == "car":
        shares[1] += WIDER * shares[0]
    size_m = np.array([body.length_m, body.width_m, body.height_m]) * (1 + shares)
    length_m, width_m, height_m = (round(float(side), 2) for side in np.minimum(size_m, LARGEST_M))
    return length_m, width_m, height_m


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
