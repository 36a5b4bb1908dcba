"""The interface through which cameras observe the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

NO_LAMP, HEAD_LAMP, TAIL_LAMP = 0, 1, 2
"""Values of `Surfaces.lamps`."""


@dataclass(frozen=True)
class PaneViews:
    """E passages of rays through window panes. rays: (E,) int64. transmittance: (E,) float32, one-way.
    normals: (3, E) float32, unit vectors towards the camera."""

    rays: Int64
    transmittance: Float32
    normals: Float32


@dataclass(frozen=True)
class Surfaces:
    """The first opaque surface of the K of R rays that meet one, and the window panes before it.

    Vectors are stored component by component, in three long rows: numpy is slow on many short ones.

    directions: (3, R) float32, of all rays. rays: (K,) int64, their indices, in any order. beyond: (R - K,)
    int64, those of the other rays. range_m: (K,) float32. points_m, normals: (3, K) float32 in the map frame,
    normals towards the camera. colour: (3, K) float32, linear diffuse reflectance of
    visible light in the primaries of sRGB. specular: (K,) float32, reflectance of a smooth surface at normal
    incidence. is_thin: (K,) bool, whether light shines through, as through leaves. is_fine: (K,) bool,
    whether it has detail below a pixel. wets: (K,) bool, whether it is a road that rain wets. is_inside:
    (K,) bool, whether it is in a room or a vehicle. lamps: (K,) uint8, see `NO_LAMP`. materials: (K,) uint8,
    equal within one material. tags: (K,) uint8, CARLA's. objects: (K,) int32, index into the road users; -1
    for everything else.
    alone_rays, alone_users: (N,) int64, all pairs of a ray and a road user that it would hit if nothing else
    were there.
    """

    directions: Float32
    rays: Int64
    beyond: Int64
    range_m: Float32
    points_m: Float32
    normals: Float32
    colour: Float32
    specular: Float32
    is_thin: npt.NDArray[np.bool_]
    is_fine: npt.NDArray[np.bool_]
    wets: npt.NDArray[np.bool_]
    is_inside: npt.NDArray[np.bool_]
    lamps: npt.NDArray[np.uint8]
    materials: npt.NDArray[np.uint8]
    tags: npt.NDArray[np.uint8]
    objects: npt.NDArray[np.int32]
    panes: PaneViews
    alone_rays: Int64
    alone_users: Int64


class VisibleSurroundings(Protocol):
    """Surroundings (see `Surroundings`) of a world that offers "surfaces"."""

    def road_users(self, range_m: float) -> Boxes:
        """See `Surroundings.road_users`."""
        ...

    def surfaces(self, rays: Float32, range_m: float, pixel_rad: float, time_s: float = 0.0) -> Surfaces:
        """Cast rays (R, 6), origin and unit direction, that all have one origin.

        pixel_rad: angle between neighbouring rays; smaller detail is averaged. time_s: after the instant, by
        which the road users have moved on.
        """
        ...

    def is_shaded(self, points_m: Float32, sun: Float32, range_m: float) -> npt.NDArray[np.bool_]:
        """Whether anything, the sensors' own vehicle included, is between points (3, N) and the sun.

        sun: (3,) unit vector towards it. range_m: of the road users that cast shadows.
        """
        ...
