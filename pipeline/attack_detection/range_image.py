"""The returns of one turn as an image: a row for each ring, from the lowest to the highest, and a column for
each firing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.sensor_geometry import Directions, SensorGeometry
from advpipe.pipeline.messages.cloud import Cloud

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class RangeImage:
    """R x C rays.

    ray: (N,) row * C + column of each point's ray, -1 for points without a direction. count: (R, C) returns.
    range_m, intensity: (R, C) of the nearest return, NaN without any.
    """

    ray: Int64
    count: Int64
    range_m: Float64
    intensity: Float64

    @classmethod
    def of(cls, cloud: Cloud, sensor: SensorGeometry) -> RangeImage:
        """That of a cloud (N,)."""
        shape = (len(sensor.elevations_rad), sensor.columns)
        row_of_ring = np.argsort(np.argsort(sensor.elevations_rad))  # unknown rings come last
        ring, column = sensor.cells(cloud)
        ray = np.where(ring >= 0, row_of_ring[ring] * sensor.columns + column, -1)
        seen = np.flatnonzero(ray >= 0)
        range_m = Directions.of(cloud).range_m
        far_first = seen[np.argsort(-range_m[seen], kind="stable")]
        nearest, intensity = np.full(shape, np.nan), np.full(shape, np.nan)
        nearest.flat[ray[far_first]] = range_m[far_first]  # the last one written is the nearest
        intensity.flat[ray[far_first]] = cloud["intensity"][far_first]
        count = np.bincount(ray[seen], minlength=shape[0] * shape[1]).reshape(shape)
        return cls(ray, count, nearest, intensity)


def window_sums(values: Float64, rows: int, columns: int) -> Float64:
    """The sum of values (R, C) over a window of odd size around each ray; columns go round, rows do not."""
    half_rows, half_columns = rows // 2, columns // 2
    padded = np.pad(values, ((half_rows, half_rows), (0, 0)))
    padded = np.pad(padded, ((0, 0), (half_columns, half_columns)), mode="wrap")
    total = np.pad(padded.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    sums: Float64 = (
        total[rows:, columns:] - total[:-rows, columns:] - total[rows:, :-columns] + total[:-rows, :-columns]
    )
    return sums
