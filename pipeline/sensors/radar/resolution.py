"""Resolution cells of range, azimuth, elevation and Doppler, their ambiguities, and the peaks among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.index_ranges import index_ranges
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.radar.section import RadarSensor

Int64 = npt.NDArray[np.int64]

RANGE, AZIMUTH, ELEVATION, VELOCITY = range(4)
"""Columns of a measurement: metres, radians, radians, metres a second."""


def resolutions(section: RadarSensor) -> Float64:
    """The width (4,) of a cell; infinite for elevation where it is not measured."""
    elevation = np.deg2rad(section.elevation_resolution_deg) or np.inf
    azimuth = np.deg2rad(section.azimuth_resolution_deg)
    return np.array([section.range_resolution_m, azimuth, elevation, section.velocity_resolution_mps])


def folded(section: RadarSensor, measured: Float64) -> Float64:
    """Measurements (N, 4) as the radar sees them: velocity and azimuth folded into their unambiguous ranges.

    The phase between antennas is proportional to the sine of the azimuth, and wraps around.
    """
    found = measured.copy()
    found[:, VELOCITY] = _wrapped(measured[:, VELOCITY], section.max_velocity_mps)
    if section.unambiguous_azimuth_deg < 90:
        half = float(np.sin(np.deg2rad(section.unambiguous_azimuth_deg)))
        beyond = np.abs(measured[:, AZIMUTH]) > np.deg2rad(section.unambiguous_azimuth_deg)
        sine = _wrapped(np.sin(measured[:, AZIMUTH]), half)
        found[beyond, AZIMUTH] = np.arcsin(sine[beyond])
    return found


def _wrapped(values: Float64, half: float) -> Float64:
    return np.asarray((values + half) % (2 * half) - half)


@dataclass(frozen=True)
class Cells:
    """K occupied cells. centre: (K, 4), mean of the content, weighted by power. signal: (K,), sum of power.
    of_users: (K,), of that from road users."""

    centre: Float64
    signal: Float64
    of_users: Float64


def fill_cells(section: RadarSensor, measured: Float64, signal: Float64, of_users: Float64) -> Cells:
    """The cells that scatterers fall into: measurements (N, 4), folded; powers (N,).

    Powers add up: the phases of scatterers in one cell are independent.
    """
    width = resolutions(section)
    bins = np.floor(measured / width).astype(np.int64)
    bins -= bins.min(axis=0, initial=0)
    spans = bins.max(axis=0, initial=0) + 1
    keys = ((bins[:, 0] * spans[1] + bins[:, 1]) * spans[2] + bins[:, 2]) * spans[3] + bins[:, 3]
    _, cell = np.unique(keys, return_inverse=True)
    total = np.bincount(cell, signal).astype(np.float64)
    total_safe = np.maximum(total, 1e-300)
    centre = np.stack([np.bincount(cell, signal * column) / total_safe for column in measured.T], axis=1)
    return Cells(centre, total, np.bincount(cell, of_users).astype(np.float64))


def are_peaks(section: RadarSensor, centre: Float64, power: Float64) -> npt.NDArray[np.bool_]:
    """Whether each of K measurements (K, 4) has more power (K,) than all within one cell's width of it.

    Two targets are resolved if they are a cell's width apart in at least one dimension.
    """
    peaks = np.ones(len(power), bool)
    first, second = _close_pairs(centre / resolutions(section))
    peaks[np.where(power[first] < power[second], first, second)] = False
    return peaks


def _close_pairs(places: Float64) -> tuple[Int64, Int64]:
    """Pairs of the rows of (K, 4) that are less than 1 apart in every column.

    Sorted by the whole part of the first column and then by the second, the candidates of a row are those
    that follow it, and some a whole part further on.
    """
    apart = 1 - 1e-9
    span = np.ptp(places[:, 1]) + 3.0 if len(places) else 0.0
    keys = np.floor(places[:, 0]) * span + places[:, 1]
    order = np.argsort(keys, kind="stable")
    places, keys = places[order], keys[order]
    own = np.arange(len(keys))
    begins = np.concatenate([own + 1, np.searchsorted(keys, keys + span - apart)])
    ends = np.searchsorted(keys, np.concatenate([keys + apart, keys + span + apart]), side="right")
    counts = ends - begins
    first = np.repeat(np.concatenate([own, own]), counts)
    second = index_ranges(begins, counts)
    for column in range(places.shape[1]):
        close = np.abs(places[first, column] - places[second, column]) <= apart
        first, second = first[close], second[close]
    return order[first], order[second]
