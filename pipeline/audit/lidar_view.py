"""A LiDAR cloud as probes see it: the array of its points, and what the sensor's clouds have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.coordinate_grid import CoordinateGrid
from advpipe.pipeline.attack_detection.scan_order import STILL, ScanOrder
from advpipe.pipeline.attack_detection.sensor_geometry import Directions, SensorGeometry
from advpipe.pipeline.audit.probe import Float64
from advpipe.pipeline.messages.cloud import Cloud, xyz

VOXEL_M = (0.1, 0.05)
"""The edges of voxels of usual detectors, on the ground."""


@dataclass(frozen=True)
class LidarHabits:
    """What the clouds of one bag show of their sensor, attacked or not: its rays, its order, its grid."""

    sensor: SensorGeometry | None
    turn: ScanOrder | None
    grid: CoordinateGrid | None

    @classmethod
    def seen_in(cls, clouds: Sequence[Cloud]) -> LidarHabits:
        """Those of some clouds of a bag."""
        filled = [cloud for cloud in clouds if len(cloud)]
        sensor = SensorGeometry.learnt(filled, STILL) if filled else None
        turn = None if sensor is None else _turn(filled, sensor)
        return cls(sensor, turn, CoordinateGrid.learnt(np.concatenate(filled)) if filled else None)


@dataclass(frozen=True)
class CloudView:
    """One cloud (N,); message_bytes, stamp_ns, log_time_ns: of its message; previous_ns: the log time of
    the one before, None for the first."""

    cloud: Cloud
    habits: LidarHabits
    message_bytes: int
    stamp_ns: int
    log_time_ns: int
    previous_ns: int | None

    @cached_property
    def points(self) -> Float64:
        """Coordinates (N, 3) in double precision."""
        return xyz(self.cloud).astype(np.float64)

    @cached_property
    def way(self) -> Directions:
        """The directions of the points."""
        return Directions.of(self.cloud)

    @cached_property
    def cells(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """The ring and the column (N,) of the ray that is nearest to each point; zeros without rings."""
        if self.habits.sensor is None:
            none = np.zeros(len(self.cloud), np.int64)
            return none, none
        return self.habits.sensor.cells(self.cloud)

    @cached_property
    def steps_back(self) -> Float64:
        """By how many rays (N,) a point stands before the place in the turn of the one before it; NaN where
        the bag shows no order."""
        if self.habits.turn is None:
            return np.full(len(self.cloud), np.nan)
        ring, column = self.cells
        keys = self.habits.turn.key(ring, self.habits.turn.place(column))
        return np.append(0.0, np.maximum(-np.diff(keys), 0))[: len(keys)]

    @cached_property
    def jump_rad(self) -> Float64:
        """The angle (N,) between a point's direction and those of its neighbours in the array, the smaller
        one."""
        unit = self.points / np.linalg.norm(self.points, axis=1, keepdims=True)
        step = np.linalg.norm(np.diff(unit, axis=0), axis=1)
        nearest: Float64 = np.fmin(np.append(np.inf, step), np.append(step, np.inf))
        return nearest

    @cached_property
    def off_ray_rad(self) -> Float64:
        """How far (N,) a point stands from the elevation of the ring that it states; NaN without rings."""
        sensor, ring = self.habits.sensor, self.cloud["ring"].astype(np.int64)
        if sensor is None:
            return np.full(len(self.cloud), np.nan)
        expected = sensor.elevations_rad[np.minimum(ring, len(sensor.elevations_rad) - 1)]
        return np.abs(self.way.elevation_rad - expected)

    @cached_property
    def off_column(self) -> Float64:
        """How far (N,) a point stands from the middle of a column, in columns; NaN without columns."""
        sensor = self.habits.sensor
        if sensor is None or not sensor.has_columns:
            return np.full(len(self.cloud), np.nan)
        place = self.way.azimuth_rad * (sensor.columns / (2 * np.pi)) - sensor.phase
        return np.abs(place - np.rint(place))

    @cached_property
    def on_ray_of(self) -> npt.NDArray[np.int64]:
        """How many points (N,) share a point's ray, itself included."""
        ring, column = self.cells
        return _multiplicity(ring * (column.max(initial=0) + 1) + column)

    @cached_property
    def same_intensity(self) -> npt.NDArray[np.int64]:
        """How many points (N,) have exactly a point's intensity, itself included."""
        return _multiplicity(np.ascontiguousarray(self.cloud["intensity"]).view("<u4"))

    @cached_property
    def same_place(self) -> npt.NDArray[np.int64]:
        """How many points (N,) have exactly a point's direction to a microradian, or its place."""
        steps = np.rint(np.column_stack([self.way.azimuth_rad, self.way.elevation_rad]) * 1e6)
        whole = np.nan_to_num(steps).astype(np.int64)
        return _multiplicity((whole[:, 0] << 32) + whole[:, 1])

    @cached_property
    def off_grid_m(self) -> Float64:
        """How far (N,) a point's coordinates lie from the grid of the others, at most; NaN without a grid."""
        grid = self.habits.grid
        if grid is None:
            return np.full(len(self.cloud), np.nan)
        off_m: Float64 = grid.offset_m(xyz(self.cloud)).max(axis=1, initial=0.0)
        return off_m

    @cached_property
    def face_distance_m(self) -> Float64:
        """How far (N,) a point lies from the faces of voxels of usual sizes, at least."""
        level = self.points[:, :2]
        distances_m = [np.abs(level - np.rint(level / edge_m) * edge_m).min(axis=1) for edge_m in VOXEL_M]
        nearest_m: Float64 = np.stack(distances_m, 1).min(axis=1)
        return nearest_m

    @cached_property
    def late_s(self) -> Float64:
        """How far (N,) a point's time lies from those of its neighbours in the array, the smaller one."""
        step = np.abs(np.diff(self.cloud["time"].astype(np.float64)))
        nearest: Float64 = np.fmin(np.append(np.inf, step), np.append(step, np.inf))
        return nearest

    @cached_property
    def compressed_share(self) -> float:
        """How many bytes are left of one of the message by Zstandard at its fastest."""
        import zstandard

        data = np.ascontiguousarray(self.cloud).tobytes()
        return len(zstandard.ZstdCompressor(1).compress(data)) / max(len(data), 1)


def _turn(clouds: Sequence[Cloud], sensor: SensorGeometry) -> ScanOrder | None:
    """The order that most clouds have: an attack may hide it in some."""
    for cloud in clouds:
        if (found := ScanOrder.learnt(cloud, sensor)) is not None:
            return found
    return None


def _multiplicity(values: npt.NDArray[np.generic]) -> npt.NDArray[np.int64]:
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    found: npt.NDArray[np.int64] = count[place.reshape(-1)]
    return found
