"""Bodies of road users: what they measure, how SUMO drives them, and their meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.scenario.traffic import UserBody
from advpipe.stages.simulate.world.raycast import cars, people, trucks, two_wheelers
from advpipe.stages.simulate.world.raycast.materials import PAINTS
from advpipe.stages.simulate.world.raycast.mesh import Mesh, box, merge
from advpipe.stages.simulate.world.raycast.user_mesh import load_mesh

Build = Callable[[float, float, float, str, float], Mesh]
"""Length, width, height, paint and a pose in [0, 1] to a mesh; `Body` makes it fit the box."""

MIRROR_M = (0.12, 0.2, 0.14)
MIRROR_OUT_M = 0.09
"""Mirrors stick so far out of the box on each side: boxes of the known data sets leave mirrors out."""


@dataclass(frozen=True)
class Body:
    """A kind of road user; the mesh without mirrors fills length x width x height, standing on z = 0.

    mirrors: where the side mirrors sit, as shares of length (from the middle) and height.
    """

    label: str
    length_m: float
    width_m: float
    height_m: float
    max_speed_mps: float
    acceleration_mps2: float
    build: Build
    mirrors: tuple[float, float] | None = None

    def hull(self, length_m: float, width_m: float, height_m: float, paint: str, pose: float = 0.5) -> Mesh:
        """The mesh without mirrors, in base_link: x forward, origin on the ground below the box's centre."""
        mesh = self.build(length_m, width_m, height_m, paint, pose)
        low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
        scale = np.array([length_m, width_m, height_m]) / (high - low)
        centred = mesh.moved(-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2])
        return centred.scaled(scale[0], scale[1], scale[2])

    def mesh(self, length_m: float, width_m: float, height_m: float, paint: str, pose: float = 0.5) -> Mesh:
        """The whole mesh, mirrors included, in base_link."""
        hull = self.hull(length_m, width_m, height_m, paint, pose)
        if self.mirrors is None:
            return hull
        x_m, z_m = self.mirrors[0] * length_m, self.mirrors[1] * height_m
        y_m = width_m / 2 + MIRROR_OUT_M - MIRROR_M[1] / 2
        mirror = box(MIRROR_M, paint)
        return merge([hull, mirror.moved(x_m, y_m, z_m), mirror.moved(x_m, -y_m, z_m)])


BODIES = {
    "sedan": Body("car", 4.75, 1.83, 1.45, 50.0, 2.6, cars.SEDAN, (0.17, 0.66)),
    "hatchback": Body("car", 4.05, 1.76, 1.5, 50.0, 2.6, cars.HATCHBACK, (0.19, 0.64)),
    "estate": Body("car", 4.75, 1.83, 1.48, 50.0, 2.6, cars.ESTATE, (0.17, 0.65)),
    "suv": Body("car", 4.7, 1.92, 1.72, 50.0, 2.6, cars.SUV, (0.17, 0.63)),
    "pickup": Body("car", 5.3, 1.98, 1.85, 50.0, 2.4, cars.PICKUP, (0.16, 0.6)),
    "van": Body("truck", 5.4, 2.05, 2.3, 40.0, 2.0, cars.VAN, (0.37, 0.52)),
    "minibus": Body("truck", 6.0, 2.02, 2.65, 36.0, 1.8, cars.MINIBUS, (0.38, 0.5)),
    "box_truck": Body("truck", 8.2, 2.5, 3.3, 28.0, 1.3, trucks.box_truck, (0.47, 0.5)),
    "semi_trailer": Body("truck", 16.5, 2.55, 4.0, 25.0, 0.9, trucks.semi_trailer, (0.485, 0.5)),
    "bus": Body("truck", 11.9, 2.55, 3.1, 25.0, 1.2, cars.BUS, (0.48, 0.62)),
    "motorcycle": Body("cyclist", 2.15, 0.8, 1.6, 45.0, 3.5, two_wheelers.motorcycle),
    "scooter": Body("cyclist", 1.85, 0.7, 1.65, 22.0, 2.5, two_wheelers.scooter),
    "bicycle": Body("cyclist", 1.8, 0.62, 1.75, 5.5, 1.2, two_wheelers.bicycle),
    "pedestrian": Body("pedestrian", 0.65, 0.6, 1.72, 1.5, 1.0, people.walking),
    "pedestrian_backpack": Body("pedestrian", 0.72, 0.6, 1.75, 1.5, 1.0, people.with_backpack),
    "pedestrian_suitcase": Body("pedestrian", 1.1, 0.62, 1.7, 1.4, 1.0, people.with_suitcase),
    "pedestrian_umbrella": Body("pedestrian", 1.0, 1.0, 2.05, 1.4, 1.0, people.with_umbrella),
    "child": Body("pedestrian", 0.5, 0.44, 1.2, 1.3, 1.0, people.walking),
}
"""Every body by name; `traffic.mix` and `vehicles.*.body` use those that drive on the road.

Sizes are those of common models: small cars of 4.05 m to the European limits of 16.5 x 2.55 x 4 m.
"""

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


def draw_variants(
    rng: np.random.Generator, user_bodies: Mapping[str, UserBody] | None = None
) -> dict[str, Variant]:
    """`VARIANTS` of each body, sizes within about 6 % of the body's, by name; one of each of the user's.

    Raises AdvpipeError for a mesh of the user's that cannot be used.
    """
    variants = {}
    for body_name, body in BODIES.items():
        for index in range(VARIANTS):
            factors = np.clip(rng.normal(1.0, 0.03, size=3), 0.93, 1.07)
            size = np.minimum(np.array([body.length_m, body.width_m, body.height_m]) * factors, LARGEST_M)
            length_m, width_m, height_m = (round(float(side), 2) for side in size)
            paint = PAINTS[int(rng.integers(len(PAINTS)))]
            name = f"{body_name}.{index}"
            mesh = body.mesh(length_m, width_m, height_m, paint, float(rng.random()))
            variants[name] = Variant(name, body, length_m, width_m, height_m, mesh)
    for body_name, given in (user_bodies or {}).items():
        variants[f"{body_name}.0"] = _user_variant(body_name, given)
    return variants


LARGEST_M = np.array([16.5, 2.6, 4.0])
"""Nothing on the road is longer, wider or higher by law (directive 96/53/EC)."""


def _user_variant(name: str, given: UserBody) -> Variant:
    mesh = load_mesh(given.mesh, f"bodies.{name}", given.material, given.scale)
    length_m, width_m, height_m = (float(side) for side in np.ptp(mesh.vertices_m, axis=0))
    body = Body(
        given.label,
        length_m,
        width_m,
        height_m,
        given.max_speed_mps,
        given.acceleration_mps2,
        lambda *_: mesh,
    )
    return Variant(f"{name}.0", body, length_m, width_m, height_m, mesh)
