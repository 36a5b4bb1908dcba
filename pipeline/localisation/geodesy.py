"""The map's frame on the Earth: a transverse Mercator projection around the scenario's origin."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pyproj

from advpipe.pipeline.geometry.transforms import Float64


class Geodesy:
    """WGS 84 coordinates of places in the map's frame; the map's y axis is true north at the origin."""

    def __init__(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        self._altitude_m = altitude_m
        projection = (
            f"+proj=tmerc +lat_0={latitude_deg!r} +lon_0={longitude_deg!r} +k=1 +datum=WGS84 +units=m"
        )
        self._projection = pyproj.Proj(projection)

    def to_geographic(self, map_m: npt.ArrayLike) -> Float64:
        """Latitude in degrees, longitude in degrees, altitude in metres (3,) of a place (3,)."""
        x, y, z = np.asarray(map_m, dtype=np.float64)
        longitude_deg, latitude_deg = self._projection(x, y, inverse=True)
        return np.array([latitude_deg, longitude_deg, self._altitude_m + z])

    def place_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """x and y of one place, as `to_map` computes them; infinite on the other side of the Earth."""
        x_m, y_m = self._projection(longitude_deg, latitude_deg)
        return float(x_m), float(y_m)

    def to_map(self, geographic: npt.ArrayLike) -> Float64:
        """The place (3,) in the map's frame of latitude, longitude, altitude (3,)."""
        latitude_deg, longitude_deg, altitude_m = np.asarray(geographic, dtype=np.float64)
        x, y = self._projection(longitude_deg, latitude_deg)
        return np.array([x, y, altitude_m - self._altitude_m])
