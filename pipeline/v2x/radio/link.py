"""The received power of each message at each station."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.radio.draws import Draws
from advpipe.pipeline.v2x.radio.fading import nakagami_db, shadowing_db
from advpipe.pipeline.v2x.radio.path_loss import PATH_LOSS, SPEED_OF_LIGHT_MPS
from advpipe.pipeline.v2x.radio.shadow_field import ShadowField
from advpipe.pipeline.v2x.radio.stations import Int64, Stations, UInt64
from advpipe.pipeline.v2x.radio.vehicle_loss import vehicle_loss_db
from advpipe.pipeline.v2x.section import Radio

NEGLIGIBLE_DB = 15.0
"""Signals this far below the noise have no effect: buildings and vehicles are not looked for."""


class Link:
    """Path loss, shadowing, fading and building loss as configured.

    Shadowing and fading are drawn anew for each message and receiver, as in Artery: they are neither
    correlated along a vehicle's way nor the same in both directions, unless there is a field of shadowing.
    """

    def __init__(
        self, radio: Radio, draws: Draws, buildings: Buildings | None, shadow: ShadowField | None = None
    ) -> None:
        self._radio = radio
        self._draws = draws
        self._shadow = shadow
        self._buildings = buildings if radio.building_loss == "obstacles" else None

    def received(
        self, stations: Stations, senders: Int64, keys: UInt64, power_dbm: Float64
    ) -> tuple[Float64, Float64]:
        """Power in dBm (M, S) and distance in metres (M, S) of messages from stations in columns (M,)."""
        radio, antenna_m = self._radio, stations.antenna_m
        distance_m = _distances_m(antenna_m, senders)
        received_dbm = PATH_LOSS[radio.path_loss](distance_m, radio)
        np.subtract(power_dbm[:, None], received_dbm, out=received_dbm)
        pairs = keys[:, None], stations.ids.astype(np.uint64)[None]
        if radio.shadowing is not None:
            sigmas = radio.shadowing.near_stddev_db, radio.shadowing.far_stddev_db
            stddev_db = np.where(distance_m <= radio.critical_distance_m, *sigmas)
            if self._shadow is None:
                received_dbm += shadowing_db(self._draws.of_pairs("shadowing", *pairs), stddev_db)
            else:  # of all pairs, so that no sum depends on who sends
                received_dbm += stddev_db * self._shadow.normal(antenna_m)[senders]
        if radio.fading == "nakagami":
            received_dbm += nakagami_db(self._draws.of_pairs("fading", *pairs), distance_m)
        if stations.bodies is not None:
            matters = received_dbm > radio.noise_dbm - NEGLIGIBLE_DB
            wavelength_m = SPEED_OF_LIGHT_MPS / radio.frequency_hz
            received_dbm -= vehicle_loss_db(antenna_m, stations.bodies, senders, matters, wavelength_m)
        if self._buildings is not None:
            matters = received_dbm > radio.noise_dbm - NEGLIGIBLE_DB
            ground_m = antenna_m[:, :2]
            walls, inside_m = self._buildings.crossings(ground_m[senders], ground_m, matters)
            received_dbm -= radio.wall_loss_db * walls + radio.inside_loss_db_per_m * inside_m
        received_dbm[np.arange(len(senders)), senders] = power_dbm
        return received_dbm, distance_m


def _distances_m(places_m: Float64, rows: Int64) -> Float64:
    """Distances (M, S) of the places in these rows (M,) from all places (S, 3)."""
    squares_m2 = [np.square(axis[rows, None] - axis) for axis in np.ascontiguousarray(places_m.T)]
    distance_m: Float64 = squares_m2[0]
    for square_m2 in squares_m2[1:]:
        distance_m += square_m2
    return np.sqrt(distance_m, out=distance_m)
