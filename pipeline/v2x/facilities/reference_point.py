"""ETSI's reference points and headings on the Earth, from poses on the map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m

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
    return reference_points(geodesy, map_SE3_base[None], np.array([length_m]))[0]


def reference_points(geodesy: Geodesy, map_SE3_base: Float64, length_m: Float64) -> list[ReferencePoint]:
    """The reference points of S vehicles: poses (S, 4, 4), lengths (S,)."""
    forward = map_SE3_base[:, :3, 0]
    fronts_m = map_SE3_base[:, :3, 3] + forward * length_m[:, None] / 2
    places = geodesy.to_geographic(np.concatenate([fronts_m, fronts_m + forward * _AHEAD_M]).T)
    fronts_deg, aheads_deg = np.split(places, 2, axis=1)
    points = []
    for front, ahead in zip(fronts_deg.T.tolist(), aheads_deg.T.tolist(), strict=True):
        latitude_deg, longitude_deg, altitude_m = front
        east_m, north_m = east_north_m(latitude_deg, longitude_deg, ahead[0], ahead[1])
        heading_rad = math.atan2(east_m, north_m) % math.tau
        points.append(ReferencePoint(latitude_deg, longitude_deg, altitude_m, heading_rad))
    return points
