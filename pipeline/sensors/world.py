"""The interface through which sensors observe the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.cloud import Cloud

Float32 = npt.NDArray[np.float32]

Offer = Literal["road users", "rays", "scans", "surfaces", "pictures", "radar hits"]
"""Names a method of `Surroundings`: sensors declare which they need, and a world which it offers. `scans`: of
`ScanningSurroundings`; `surfaces`: of `VisibleSurroundings`; `pictures`: of `PicturingSurroundings`; `radar
hits`: of `RadarSurroundings`."""


SURFACES = (
    "road", "marking", "pavement", "ground", "vegetation", "building", "pole", "sign", "barrier",
    "vehicle", "person", "other",
)  # fmt: skip
"""What a ray hits, as far as a radar distinguishes it."""


@dataclass(frozen=True)
class SurfaceDetail:
    """What is finer than the shapes of surfaces, at the hits of R rays.

    texture: (R,) float32, factor of the reflectivity, 1 on average. relief_m: (R,) float32, how far the
    surface stands out there, along its normal. gloss: (R,) float32 in [0, 1], share of the reflectivity that
    is returned only near the normal, as by metallic paint. Texture and relief are fixed to the surface.
    """

    texture: Float32
    relief_m: Float32
    gloss: Float32


@dataclass(frozen=True)
class Hits:
    """The first hit of each of R rays.

    range_m: (R,) float32, infinite where a ray hits nothing. cos_incidence: (R,) float32 in [0, 1], cosine of
    the angle to the surface's normal. reflectivity: (R,) float32 in [0, 1], diffuse, at 905 nm.
    retroreflective: (R,) bool, whether the surface reflects light back to its source.
    transmission: (R,) float32, two-way transmission of the window panes on the way.
    The values above, except range_m, are arbitrary where a ray hits nothing.
    objects: (R,) int32, index into the road users of `Surroundings.road_users`; -1 for everything else.
    occlusion: (M,) float32 in [0, 1], for each of the M road users the share of the rays that would hit it if
    nothing else were there, but hit something else first; 0 if no ray would hit it.
    """

    range_m: Float32
    cos_incidence: Float32
    reflectivity: Float32
    retroreflective: npt.NDArray[np.bool_]
    transmission: Float32
    objects: npt.NDArray[np.int32]
    occlusion: Float32

    @property
    def surfaces(self) -> npt.NDArray[np.uint8] | None:
        """Index into `SURFACES` (R,), arbitrary where a ray hits nothing; None in a world that names none."""
        return None

    def detail(self) -> SurfaceDetail | None:
        """The detail at the hits of the R rays, arbitrary where a ray hits nothing; None in a world of
        smooth, plain surfaces."""
        return None


class Surroundings(Protocol):
    """The world around one vehicle at one instant, in the map frame, without the vehicle itself."""

    def road_users(self, range_m: float) -> Boxes:
        """All road users within `range_m` of the vehicle's position, with ids and velocities.

        Moving ones come first; parked cars, which are road users, too, come last.
        """
        ...

    def cast(self, rays: Float32, range_m: float) -> Hits:
        """Cast rays (R, 6), origin and unit direction, whose origins are close to each other.

        They can hit all static objects, and the road users of `road_users(range_m)`.
        """
        ...


@dataclass(frozen=True)
class Scan:
    """One turn of a LiDAR that the world itself simulates.

    cloud: in the LiDAR's frame. occlusion: (M,) of M road users, as in `Hits`. semantic: the same turn as
    points of `SEMANTIC_POINT_DTYPE`, where the drive records them.
    """

    cloud: Cloud
    occlusion: Float32
    semantic: Cloud | None = None


@runtime_checkable
class ScanningSurroundings(Protocol):
    """The surroundings in a world whose own LiDARs measure, such as another simulator's."""

    def scan(self, name: str, range_m: float) -> Scan:
        """The turn of the vehicle's LiDAR `name` that ends now; M as in `road_users(range_m)`."""
        ...


@runtime_checkable
class RadarSurroundings(Protocol):
    """The surroundings in a world whose own radars measure."""

    def radar_hits(self, name: str, radar_mps: Float64) -> Float64:
        """What the vehicle's radar `name` measures now (N, 4): range in metres, azimuth and elevation in
        radians in its right-handed frame, and the rate of range in m/s.

        radar_mps: (3,), its own velocity over the ground, in its own axes.
        """
        ...


@runtime_checkable
class CarrierSurroundings(Protocol):
    """The surroundings in a world that knows the body of the vehicle itself."""

    def cast_own_body(self, rays: Float32) -> Hits:
        """Cast rays (R, 6) in the vehicle's base_link into its own body alone; `objects` is -1."""
        ...
