"""The meshes of road users' bodies, one for each variant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from advpipe.pipeline.scenario.traffic import UserBody
from advpipe.stages.simulate.bodies import Variant
from advpipe.stages.simulate.world.raycast import car_shapes, people, postures, trucks, two_wheelers
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge
from advpipe.stages.simulate.world.raycast.user_mesh import load_mesh

Build = Callable[[float, float, float, str, float], Mesh]
"""Builds a mesh from length, width and height in metres, paint, and a pose in [0, 1]; `hull` scales it
to the box."""

MIRROR_M = (0.12, 0.2, 0.14)
MIRROR_OUT_M = 0.09
"""How far mirrors stick out of the box on each side: the boxes of common data sets exclude mirrors."""


@dataclass(frozen=True)
class Shape:
    """How a body is built; the mesh without mirrors fills its box, standing on z = 0.

    mirrors: where the side mirrors sit, as shares of length (from the middle) and height.
    """

    build: Build
    mirrors: tuple[float, float] | None = None


SHAPES: Mapping[str, Shape] = {
    "city_car": Shape(car_shapes.CITY_CAR, (0.25, 0.64)),
    "supermini": Shape(car_shapes.SUPERMINI, (0.22, 0.64)),
    "hatchback": Shape(car_shapes.HATCHBACK, (0.19, 0.64)),
    "sedan": Shape(car_shapes.SEDAN, (0.17, 0.66)),
    "estate": Shape(car_shapes.ESTATE, (0.17, 0.65)),
    "estate_roof_box": Shape(car_shapes.estate_with_roof_box, (0.17, 0.52)),
    "executive": Shape(car_shapes.EXECUTIVE, (0.16, 0.66)),
    "small_suv": Shape(car_shapes.SMALL_SUV, (0.19, 0.63)),
    "suv": Shape(car_shapes.SUV, (0.17, 0.63)),
    "coupe": Shape(car_shapes.COUPE, (0.14, 0.68)),
    "mpv": Shape(car_shapes.MPV, (0.25, 0.6)),
    "compact_van": Shape(car_shapes.COMPACT_VAN, (0.22, 0.58)),
    "pickup": Shape(car_shapes.PICKUP, (0.16, 0.6)),
    "van": Shape(car_shapes.VAN, (0.37, 0.52)),
    "minibus": Shape(car_shapes.MINIBUS, (0.38, 0.5)),
    "box_truck": Shape(trucks.box_truck, (0.47, 0.5)),
    "tipper": Shape(trucks.tipper, (0.46, 0.55)),
    "semi_trailer": Shape(trucks.semi_trailer, (0.485, 0.5)),
    "bus": Shape(car_shapes.BUS, (0.48, 0.62)),
    "motorcycle": Shape(two_wheelers.motorcycle),
    "scooter": Shape(two_wheelers.scooter),
    "bicycle": Shape(two_wheelers.bicycle),
    "cargo_bike": Shape(two_wheelers.cargo_bike),
    "kick_scooter": Shape(two_wheelers.kick_scooter),
    "pedestrian": Shape(people.walking),
    "pedestrian_backpack": Shape(people.with_backpack),
    "pedestrian_suitcase": Shape(people.with_suitcase),
    "pedestrian_umbrella": Shape(people.with_umbrella),
    "pedestrian_pushchair": Shape(people.with_pushchair),
    "child": Shape(people.walking),
    "pedestrian_standing": Shape(postures.standing),
    "pedestrian_sitting": Shape(postures.sitting),
    "pedestrian_bending": Shape(postures.bending),
}
"""Shapes by the name of the body."""


def body_meshes(variants: Mapping[str, Variant], user_bodies: Mapping[str, UserBody]) -> dict[str, Mesh]:
    """The mesh of each variant in base_link, mirrors included, by the variant's name.

    Raises AdvpipeError for an unusable mesh or material of the user.
    """
    return {
        name: _user_mesh(variant.body.name, user_bodies[variant.body.name])
        if variant.body.name in user_bodies
        else body_mesh(variant)
        for name, variant in variants.items()
    }


@lru_cache(maxsize=1024)  # the same ones in every drive of a process
def body_mesh(variant: Variant) -> Mesh:
    """The mesh of a built-in body, mirrors included, in base_link."""
    mirrors = SHAPES[variant.body.name].mirrors
    if mirrors is None:
        return hull(variant)
    x_m, z_m = mirrors[0] * variant.length_m, mirrors[1] * variant.height_m
    y_m = variant.width_m / 2 + MIRROR_OUT_M - MIRROR_M[1] / 2
    mirror = box_mesh(MIRROR_M, variant.paint)
    return merge([hull(variant), mirror.moved(x_m, y_m, z_m), mirror.moved(x_m, -y_m, z_m)])


def hull(variant: Variant) -> Mesh:
    """The mesh without mirrors, in base_link: x forward, origin on the ground below the box's centre."""
    size_m = variant.length_m, variant.width_m, variant.height_m
    mesh = SHAPES[variant.body.name].build(*size_m, variant.paint, variant.pose)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    scale = np.array(size_m) / (high - low)
    centred = mesh.moved(-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2])
    return centred.scaled(scale[0], scale[1], scale[2])


def _user_mesh(name: str, body: UserBody) -> Mesh:
    return load_mesh(body.mesh, f"bodies.{name}", body.material, body.scale)
