"""CARLA's GNSS and IMU, as error-free readings in the map's frame and in base_link."""

from __future__ import annotations

from typing import Any

import numpy as np

from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.world.carla.poses import vector_of

GNSS, IMU = "sensor.other.gnss", "sensor.other.imu"

AGREEMENT_M = 1.0
DECIDED_M = 5.0
"""From this distance to the map's x axis on, the two directions of latitude can be told apart."""


def specific_force_of(data: Any) -> Float64:
    """(3,) in m/s², right-handed, from a `carla.IMUMeasurement`; +9.81 upwards at rest."""
    return vector_of(data.accelerometer)


def turn_rate_of(data: Any) -> Float64:
    """(3,) in rad/s, right-handed. A turn about an axis changes its sign with the mirrored axis."""
    rate = data.gyroscope
    return np.array([-rate.x, rate.y, -rate.z])


class GnssProjection:
    """Places in the map's frame of CARLA's geographic positions, by the map's own projection.

    Releases differ in whether latitude grows to the north: 0.9.16's client lets it grow with CARLA's y, which
    is to the south. The first reading far enough from the x axis decides it, by the sensor's true place.
    """

    def __init__(self, carla_map: Any) -> None:
        self._map = carla_map
        self._sign: int | None = None
        self._is_useless = False

    def position_m(self, data: Any) -> Float64 | None:
        """The sensor's place (3,) in the map's frame; None where CARLA's readings do not fit its map."""
        true_m = vector_of(data.transform.location)
        place_m = self._inverse(data, true_m)
        signs = (1, -1) if self._sign is None else (self._sign,)
        away_m = {sign: float(np.abs(place_m * (1, sign, 1) - true_m).max()) for sign in signs}
        sign = min(away_m, key=lambda one: away_m[one])
        if away_m[sign] > AGREEMENT_M:
            if not self._is_useless:
                self._is_useless = True
                off_m = away_m[sign]
                notice(f"CARLA's GNSS is {off_m:.1f} m off its own map; true positions are measured instead")
            return None
        if self._sign is None and abs(true_m[1]) > DECIDED_M:
            self._sign = sign
        position: Float64 = place_m * (1, sign, 1)
        return position

    def _inverse(self, data: Any, start_m: Float64) -> Float64:
        """The place (x, y to the left) whose geographic position by the map is that of the reading."""
        wanted, place = np.array([data.latitude, data.longitude]), start_m[:2]
        for _ in range(4):  # Newton's method; the projection is all but linear
            here = self._geographic(place)
            slope = np.stack([self._geographic(place + step) - here for step in np.eye(2)], axis=1)
            place = place + np.linalg.solve(slope, wanted - here)
        return np.array([*place, data.altitude])

    def _geographic(self, place_m: Float64) -> Float64:
        import carla

        found = self._map.transform_to_geolocation(carla.Location(float(place_m[0]), float(-place_m[1]), 0.0))
        return np.array([found.latitude, found.longitude])
