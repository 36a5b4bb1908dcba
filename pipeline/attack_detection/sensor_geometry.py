"""The rays of a rotating LiDAR, learnt from clean clouds: what every defender and every attacker can know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.messages.cloud import Cloud, chosen_points, xyz

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

MIN_TOLERANCE_RAD = 4e-7
"""More than the angle by which rounding to float32, twice, turns a ray."""

TYPICAL = 0.999
"""The share of clean points that lie within half of a tolerance; others may be of moving objects."""

MIN_RANGE_M = 0.5
"""Points nearer than this have no direction to rely on."""

MAX_SPREAD = 0.25
"""Of the spacing of rings, or of columns: with a larger spread, they are unknown."""


NEAR_COLUMNS = 0.01
"""By what share the median step between points may misjudge the number of columns."""

MOST_COLUMNS_OFF = 40
"""And by how many, at most: usual LiDARs have up to 4,000."""


@dataclass(frozen=True)
class Directions:
    """The directions of points (N,) from the sensor. azimuth_rad: in [-pi, pi]. range_m: NaN where a point
    is not finite or too near."""

    elevation_rad: Float64
    azimuth_rad: Float64
    range_m: Float64

    @classmethod
    def of(cls, cloud: Cloud) -> Directions:
        """Those of a cloud (N,)."""
        x, y, z = xyz(cloud).astype(np.float64).T
        flat_m = np.hypot(x, y)
        range_m = np.hypot(flat_m, z)
        range_m[~(np.isfinite(range_m) & (range_m > MIN_RANGE_M))] = np.nan
        return cls(np.arctan2(z, flat_m), np.arctan2(y, x), range_m)

    @classmethod
    def joined(cls, parts: Sequence[Directions]) -> Directions:
        """Those of several clouds, in order."""
        return cls(
            np.concatenate([part.elevation_rad for part in parts]),
            np.concatenate([part.azimuth_rad for part in parts]),
            np.concatenate([part.range_m for part in parts]),
        )

    def among(self, which: Bool) -> Directions:
        """Those of some points (N,)."""
        return Directions(self.elevation_rad[which], self.azimuth_rad[which], self.range_m[which])


@dataclass(frozen=True)
class SensorGeometry:
    """The elevation of each ring, and the columns of a turn.

    elevations_rad: (R,), NaN for rings that no clean point has. columns: firings of a ring in one turn.
    phase: azimuth * columns / (2 pi) of the columns, modulo 1. has_columns: whether every point lies in the
    middle of a column; otherwise columns only have the right width. Tolerances: of clean points.
    """

    elevations_rad: Float64
    elevation_tolerance_rad: float
    columns: int
    phase: float
    azimuth_tolerance_rad: float
    has_columns: bool

    @classmethod
    def learnt(cls, clean: Sequence[Cloud], typical: float = TYPICAL) -> SensorGeometry | None:
        """From clean clouds; None if they tell no rings apart. typical: the share of points on their rays."""
        if len(clean) == 1 and len(clean[0]) and (clean[0]["ring"] == clean[0]["ring"][0]).all():
            return None  # most clouds without rings: nothing has to be computed
        ways = [Directions.of(each) for each in clean]
        seen = [np.isfinite(each.range_m) for each in ways]
        cloud = np.concatenate([chosen_points(*each) for each in zip(clean, seen, strict=True)])
        rings = np.unique(cloud["ring"])
        if len(rings) < 2:
            return None
        way = Directions.joined([each.among(finite) for each, finite in zip(ways, seen, strict=True)])
        elevations = np.full(int(rings[-1]) + 1, np.nan)
        for ring in rings:
            elevations[ring] = np.median(way.elevation_rad[cloud["ring"] == ring])
        off_rad = np.abs(way.elevation_rad - elevations[cloud["ring"]])
        spacing_rad = float(np.median(np.abs(np.diff(elevations[rings]))))
        if np.quantile(off_rad, typical) > MAX_SPREAD * spacing_rad:
            return None
        fullest = rings[np.argmax(np.bincount(cloud["ring"])[rings])]
        azimuths = [
            each.azimuth_rad[points["ring"] == fullest] for each, points in zip(ways, clean, strict=True)
        ]
        steps_rad = np.concatenate([np.diff(np.sort(each)) for each in azimuths])
        columns = max(1, round(2 * np.pi / max(float(np.median(steps_rad)), 1e-5)))
        phase, off = _phase(way.azimuth_rad, columns, typical)
        if off >= MAX_SPREAD:  # rounded coordinates blur the steps
            columns = _sharpest(np.concatenate(azimuths), columns)
            phase, off = _phase(way.azimuth_rad, columns, typical)
        return cls(
            elevations,
            max(MIN_TOLERANCE_RAD, 2 * float(np.quantile(off_rad, typical))),
            columns,
            phase,
            max(MIN_TOLERANCE_RAD, 2 * off * 2 * np.pi / columns),
            has_columns=off < MAX_SPREAD,
        )

    def off_ray(self, cloud: Cloud) -> Bool:
        """Which points (N,) lie farther from the elevation of their ring, or from the middle of a column,
        than clean ones do. A point that is not finite is not among them; one of an unknown ring is."""
        way, ring = Directions.of(cloud), cloud["ring"].astype(np.int64)
        is_known = ring < len(self.elevations_rad)
        expected = self.elevations_rad[np.where(is_known, ring, 0)]
        off = ~(np.abs(way.elevation_rad - expected) <= self.elevation_tolerance_rad) | ~is_known
        if self.has_columns:
            place = way.azimuth_rad * (self.columns / (2 * np.pi)) - self.phase
            beside_rad = np.abs(place - np.rint(place)) * (2 * np.pi / self.columns)
            off |= beside_rad > self.azimuth_tolerance_rad / np.maximum(np.cos(way.elevation_rad), 0.1)
        return np.isfinite(way.range_m) & off

    def cells(self, cloud: Cloud) -> tuple[Int64, Int64]:
        """Ring and column (N,) of the ray nearest to each point, whatever ring it states; ring -1 for points
        without a direction."""
        way = Directions.of(cloud)
        known = np.flatnonzero(np.isfinite(self.elevations_rad))
        by_height = known[np.argsort(self.elevations_rad[known])]
        heights = self.elevations_rad[by_height]
        nearest = np.searchsorted((heights[1:] + heights[:-1]) / 2, way.elevation_rad)
        place = way.azimuth_rad * (self.columns / (2 * np.pi)) - self.phase
        column = np.rint(np.nan_to_num(place)).astype(np.int64)
        return np.where(np.isfinite(way.range_m), by_height[nearest], -1), column % self.columns

    def directions(self, ring: Int64, column: Int64) -> Float64:
        """The unit vectors (K, 3) of rays."""
        azimuth_rad = (column + self.phase) * (2 * np.pi / self.columns)
        elevation_rad = self.elevations_rad[ring]
        flat = np.cos(elevation_rad)
        return np.column_stack(
            [flat * np.cos(azimuth_rad), flat * np.sin(azimuth_rad), np.sin(elevation_rad)]
        )


def _phase(azimuth_rad: Float64, columns: int, typical: float) -> tuple[float, float]:
    """The phase of azimuths (N,), and how far, in columns, that share of them lies from the middle of one."""
    place = azimuth_rad * (columns / (2 * np.pi))
    phase = float(np.angle(np.exp(2j * np.pi * place).mean()) / (2 * np.pi)) % 1.0
    off_columns = np.abs(place - phase - np.rint(place - phase))
    return phase, float(np.quantile(off_columns, typical))


def _sharpest(azimuth_rad: Float64, columns: int) -> int:
    """The number of columns near a first estimate on which azimuths (N,) lie best."""
    reach = min(round(columns * NEAR_COLUMNS), MOST_COLUMNS_OFF)
    near = range(max(1, columns - reach), columns + reach + 1)
    return max(near, key=lambda count: abs(np.exp(1j * count * azimuth_rad).mean()))
