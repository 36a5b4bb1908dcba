"""What a sensor may ask of the world: the only way in which sensors know it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes

Float32 = npt.NDArray[np.float32]

Offer = Literal["road users", "rays"]
"""A method of `Surroundings` in words: what sensors need, and what a world offers."""


@dataclass(frozen=True)
class Hits:
    """What each of R rays met first.

    range_m: (R,) float32, infinite where a ray met nothing. cos_incidence: (R,) float32 in [0, 1], of the
    angle to the surface's normal. reflectivity: (R,) float32 in [0, 1], diffuse, at 905 nm.
    retroreflective: (R,) bool, whether the surface sends light back to where it came from.
    transmission: (R,) float32, the share of light that window panes leave on the way there and back.
    Where a ray met nothing, these are any numbers.
    objects: (R,) int32, index into the road users of `Surroundings.road_users`; -1 for everything else.
    occlusion: float32 in [0, 1] for each of those road users: of the rays that would meet it, were it
    alone, the share that meets something else first; 0 where no ray would.
    """

    range_m: Float32
    cos_incidence: Float32
    reflectivity: Float32
    retroreflective: npt.NDArray[np.bool_]
    transmission: Float32
    objects: npt.NDArray[np.int32]
    occlusion: Float32


class Surroundings(Protocol):
    """The world around one vehicle at one instant, in the map's frame; the vehicle itself is not in it."""

    def road_users(self, range_m: float) -> Boxes:
        """Who is at most so far away, from the vehicle's place to theirs, with ids and velocities.

        Those that move come first, parked cars, which count as road users, last.
        """
        ...

    def cast(self, rays: Float32, range_m: float) -> Hits:
        """Casts rays (R, 6), origin and unit direction, that start near one another.

        They meet everything that stands still, and of the road users those of `road_users(range_m)`.
        """
        ...
