"""In what order a rotating LiDAR writes the points of a turn, and when it measures each."""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass, replace
from weakref import ref

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.sensor_geometry import SensorGeometry
from advpipe.pipeline.geometry.lengths import lengths
from advpipe.pipeline.geometry.nearest_points import nearest_points
from advpipe.pipeline.messages.cloud import Cloud, xyz

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]

MOST_BREAKS = 0.002
"""The share of steps against the order, at most: points on moving objects leave their column a little."""


STILL = 0.8
"""The share of points, at least, that do not move: those on moving objects may lie beside their rays."""


@dataclass(frozen=True)
class ScanOrder:
    """The order of a clean cloud (N,): column by column or ring by ring, as `keys` counts them.

    turn: 1 if the columns ascend with the azimuth, -1 if they descend. first: the column of a turn's start.
    rise: 1 if rings ascend within a column, -1 if they descend. keys: (N,) of the clean points, ascending.
    """

    sensor: SensorGeometry
    by_column: bool
    turn: int
    first: int
    rise: int
    cloud: Cloud
    keys: Int64

    @classmethod
    def learnt(cls, cloud: Cloud, sensor: SensorGeometry) -> ScanOrder | None:
        """From a clean cloud; None if its points have neither order."""
        near, column = sensor.cells(cloud)
        seen = np.flatnonzero(near >= 0)
        if len(seen) < 2:
            return None
        ring, column = cloud["ring"][seen].astype(np.int64), column[seen]
        step = _wrapped(np.diff(column), sensor.columns)
        turn = 1 if step.sum() >= 0 else -1
        same = step == 0
        climb = np.diff(ring)[same]
        rise = 1 if (climb > 0).sum() >= (climb < 0).sum() else -1
        gap = int(turn * (column[0] - column[-1])) % sensor.columns
        first = int(column[0]) - turn * (gap // 2)
        within = np.flatnonzero(np.diff(ring) == 0)
        ring_turn = 1 if step[within].sum() >= 0 else -1
        ring_rise = 1 if np.diff(ring).sum() >= 0 else -1
        ways = ((True, turn, first, rise), (False, ring_turn, int(column[0]), ring_rise))
        for by_column, way, start, up in ways:
            found = cls(sensor, by_column, way, start, up, cloud, np.zeros(0, np.int64))
            keys = found.key(ring, found.own_place(seen, column))
            if (np.diff(keys) < 0).mean() <= MOST_BREAKS:
                filled = np.full(len(cloud), -1, np.int64)
                filled[seen] = keys
                return replace(found, keys=np.maximum.accumulate(filled))
        return None

    def place(self, column: Int64) -> Int64:
        """How many columns of the turn come before columns (K,)."""
        return (self.turn * (column - self.first)) % self.sensor.columns

    def own_place(self, seen: Int64, column: Int64) -> Int64:
        """The same of points of the clean cloud, by index (K,), and the columns in which they appear.

        Points of one instant left in one column, also those on moving objects, which stand beside it; a LiDAR
        that turns evenly has its columns at even times.
        """
        time, place = self.cloud["time"][seen], self.place(column)
        if len(seen) < 2 or not (np.diff(time) >= 0).all() or time[0] == time[-1]:
            return place
        starts = np.flatnonzero(np.append(True, np.diff(time) > 0))
        ends = np.append(starts[1:], len(seen))
        middle = np.array([np.median(place[start:end]) for start, end in zip(starts, ends, strict=True)])
        at_s, half = time[starts].astype(np.float64), len(starts) // 2
        slope = np.median(
            (middle[half:] - middle[: len(middle) - half]) / (at_s[half:] - at_s[: len(at_s) - half])
        )
        line = slope * at_s + np.median(middle - slope * at_s)
        if (np.abs(middle - line) < 0.5).mean() >= STILL:
            middle = np.rint(line)
        return np.repeat(middle.astype(np.int64), ends - starts)

    def key(self, ring: Int64, place: Int64) -> Int64:
        """The place (K,) of rays in the turn, empty ones counted; the rings are those of `SensorGeometry`."""
        rings = len(self.sensor.elevations_rad)
        level = ring if self.rise > 0 else rings - 1 - ring
        return place * rings + level if self.by_column else level * self.sensor.columns + place

    def times(self, ring: Int64, column: Int64) -> npt.NDArray[np.float32]:
        """When the sensor measures rays (K,): as it did those of the same column, or between them, of the
        same ring if the rings of a column have times of their own."""
        time = self.cloud["time"]
        if not len(time) or (time == time[0]).all():
            return np.full(len(ring), time[0] if len(time) else 0, np.float32)
        near, own_column = self.sensor.cells(self.cloud)
        seen, own_ring = np.flatnonzero((near >= 0) & np.isfinite(time)), self.cloud["ring"]
        place, wanted = self.own_place(seen, own_column[seen]), self.place(column)
        own_s, group = time[seen], np.zeros(len(seen), np.int64)
        lowest, highest = np.full(self.sensor.columns, np.inf), np.full(self.sensor.columns, -np.inf)
        np.minimum.at(lowest, place, own_s)
        np.maximum.at(highest, place, own_s)
        filled = np.isfinite(lowest)
        asked = np.zeros(len(ring), np.int64)
        if (lowest[filled] != highest[filled]).mean() > MOST_BREAKS:
            group, asked = own_ring[seen].astype(np.int64), ring
        found = np.zeros(len(ring), np.float32)
        for one in np.unique(asked):
            mine, theirs = group == one, asked == one
            if not mine.any():
                mine = np.ones(len(seen), bool)
            known, where = np.unique(place[mine], return_index=True)
            found[theirs] = np.interp(wanted[theirs], known, own_s[mine][where].astype(np.float64))
        return found


_LAST: ContextVar[tuple[ref[Cloud], ScanOrder | None] | None] = ContextVar("scan order", default=None)


def scan_order_of(cloud: Cloud) -> ScanOrder | None:
    """The order of a clean cloud; None where it tells none. That of the last cloud is remembered, if nobody
    can write to it."""
    last = _LAST.get()
    if last is not None and last[0]() is cloud:
        return last[1]
    sensor = SensorGeometry.learnt([cloud], STILL) if len(cloud) else None
    found = None if sensor is None else ScanOrder.learnt(cloud, sensor)
    _LAST.set(None if cloud.flags.writeable else (ref(cloud), found))
    return found


def as_measured(cloud: Cloud, added: Cloud, order: ScanOrder | None) -> Cloud:
    """Added points (K,) with the ring and the time that the sensor would state for their directions."""
    if order is None or not len(added):
        return added
    stated = added.copy()
    ring, column = order.sensor.cells(added)
    stated["ring"] = np.where(ring >= 0, ring, added["ring"])
    stated["time"] = order.times(np.maximum(ring, 0), column)
    return stated


def places_in_scan(cloud: Cloud, added: Cloud, order: ScanOrder | None) -> Int64:
    """Before which of the points of a cloud (N,) the sensor would have written each added one (K,): N for
    its end. Where the order of the points is unknown, beside the one that is nearest in direction."""
    if order is None:
        return _beside_nearest(cloud, added)
    found: Int64 = np.searchsorted(order.keys, scan_keys(added, order), side="right").astype(np.int64)
    return found


def scan_keys(added: Cloud, order: ScanOrder | None) -> Int64:
    """The order (K,) of added points among each other; all equal where that of the cloud is unknown."""
    if order is None:
        return np.zeros(len(added), np.int64)
    ring, column = order.sensor.cells(added)
    return order.key(ring, order.place(column))


def _beside_nearest(cloud: Cloud, added: Cloud) -> Int64:
    own = _directions(cloud)
    seen = np.flatnonzero(np.isfinite(own[:, 0]) & np.isfinite(own[:, 1]) & np.isfinite(own[:, 2]))
    if not len(seen):
        return np.full(len(added), len(cloud), np.int64)
    wanted = _directions(added)
    _, nearest = nearest_points(own[seen], np.nan_to_num(wanted), None)
    before, after = own[seen[np.maximum(nearest - 1, 0)]], own[seen[np.minimum(nearest + 1, len(seen) - 1)]]
    is_later = lengths(wanted - after) < lengths(wanted - before)
    beside: Int64 = (seen[nearest] + is_later).astype(np.int64)
    return beside


def _directions(cloud: Cloud) -> Float64:
    points = xyz(cloud).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        way: Float64 = points / lengths(points)[:, None]
    return way


def _wrapped(steps: Int64, columns: int) -> Int64:
    """Steps between columns by the shorter way round."""
    return (steps + columns // 2) % columns - columns // 2
