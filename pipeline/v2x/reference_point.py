"""Where a vehicle is for ETSI: its reference point and heading on the Earth, from its pose on the map."""

from __future__ import annotations

import math
from typing import NamedTuple

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.ellipsoid import east_north_m

_AHEAD_M = 10.0


class ReferencePoint(NamedTuple):
    """WGS 84; heading clockwise from true north in [0, 2 pi)."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    heading_rad: float


def reference_point(geodesy: Geodesy, map_SE3_base: Float64, length_m: float) -> ReferencePoint:
    """The ground below the middle of the front side of a box `length_m` long (EN 302 637-2, B.19).

    map_SE3_base: (4, 4), the ground below the box's centre. The map's y axis points to true north at its
    origin only, so the heading is taken between two places on the Earth.
    """
    forward = map_SE3_base[:3, 0]
    front_m = map_SE3_base[:3, 3] + forward * length_m / 2
    latitude_deg, longitude_deg, altitude_m = (float(value) for value in geodesy.to_geographic(front_m))
    ahead_deg = geodesy.to_geographic(front_m + forward * _AHEAD_M)
    east_m, north_m = east_north_m(latitude_deg, longitude_deg, float(ahead_deg[0]), float(ahead_deg[1]))
    return ReferencePoint(latitude_deg, longitude_deg, altitude_m, math.atan2(east_m, north_m) % math.tau)
