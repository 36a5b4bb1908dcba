"""Short distances on WGS 84."""

from __future__ import annotations

import math

_A_M, _E2 = 6_378_137.0, 0.00669437999014
"""Semi-major axis, and first eccentricity squared."""


def east_north_m(
    latitude_deg: float, longitude_deg: float, to_latitude_deg: float, to_longitude_deg: float
) -> tuple[float, float]:
    """East and north of one place from another near it, by the ellipsoid's radii of curvature there.

    Within 1e-6 of the geodesic over 100 m, away from the poles.
    """
    middle_rad = math.radians((latitude_deg + to_latitude_deg) / 2)
    squeeze = 1 - _E2 * math.sin(middle_rad) ** 2
    across_m = _A_M / math.sqrt(squeeze)  # radius in the prime vertical
    along_m = across_m * (1 - _E2) / squeeze  # radius in the meridian
    east_rad = math.radians(math.remainder(to_longitude_deg - longitude_deg, 360.0))
    north_rad = math.radians(to_latitude_deg - latitude_deg)
    return across_m * math.cos(middle_rad) * east_rad, along_m * north_rad
