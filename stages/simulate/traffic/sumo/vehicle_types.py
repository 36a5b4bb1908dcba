"""Vehicle types: ours for SUMO, and our substitutes for the user's."""

from __future__ import annotations

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from advpipe.stages.simulate.bodies import Variant, variants_of

CARS = ("sedan", "hatchback", "estate", "suv", "pickup")
BODIES_OF_CLASS: dict[str, tuple[str, ...]] = {
    "passenger": CARS,
    "private": CARS,
    "evehicle": CARS,
    "taxi": CARS,
    "authority": CARS,
    "army": CARS,
    "vip": CARS,
    "hov": CARS,
    "custom1": CARS,
    "custom2": CARS,
    "ignoring": CARS,
    "delivery": ("van",),
    "emergency": ("van",),
    "truck": ("box_truck", "semi_trailer"),
    "trailer": ("semi_trailer",),
    "bus": ("minibus", "bus"),
    "coach": ("bus",),
    "motorcycle": ("motorcycle",),
    "moped": ("scooter",),
    "scooter": ("scooter",),
    "bicycle": ("bicycle",),
    "wheelchair": ("bicycle",),
}
"""Bodies that represent a vClass of SUMO; rail, water, air and pedestrian classes have none."""

NEAREST_VARIANTS = 3
"""A vehicle of the user's gets one of this many variants nearest to its length, drawn by the seed."""


def substitute_variant(
    variants: Mapping[str, Variant], vclass: str, length_m: float, rng: np.random.Generator
) -> Variant:
    """The variant that represents a vehicle of a known class and length."""
    names = [name for body in BODIES_OF_CLASS[vclass] for name in variants_of(variants, body)]
    names.sort(key=lambda name: (abs(variants[name].length_m - length_m), name))
    return variants[names[int(rng.integers(min(NEAREST_VARIANTS, len(names))))]]


def vehicle_types_xml(variants: Mapping[str, Variant]) -> str:
    """An additional file with one SUMO vehicle type for each variant.

    Pedestrians are included, so that cars brake for one that a trajectory moves.
    """
    lines = []
    for name, variant in variants.items():
        attributes = {"id": name, **type_attributes(variant)}
        text = " ".join(f"{key}={quoteattr(str(value))}" for key, value in attributes.items())
        lines.append(f"  <vType {text}/>")
    return "<additional>\n" + "\n".join(lines) + "\n</additional>\n"


def type_attributes(variant: Variant) -> dict[str, str | float]:
    """Attributes of the vehicle type that represents a variant, by their names in SUMO's files."""
    body = variant.body
    return {
        "vClass": "passenger",  # bodies differ in size and speed alone, not in the lanes that they may use
        "length": variant.length_m,
        "width": variant.width_m,
        "height": variant.height_m,
        "maxSpeed": body.max_speed_mps,
        "accel": body.acceleration_mps2,
        "latAlignment": "right" if body.label == "cyclist" else "center",
        "minGapLat": 0.4,
        "lcMaxSpeedLatStanding": 0.0,
        "lcMaxSpeedLatFactor": 0.25,
    }
