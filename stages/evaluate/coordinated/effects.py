"""What attacks of several kinds do to one vehicle over time, in the clean bag and in the attacked one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.topics import V2X_STATIONS, VehicleTopics
from advpipe.stages.evaluate.cooperative.pair import poses
from advpipe.stages.evaluate.coordinated.attack_timeline import Int64, touched_points
from advpipe.stages.evaluate.v2x.ldm_error import ldm_error, moments
from advpipe.stages.evaluate.v2x.recording import read_recording


@dataclass(frozen=True)
class Series:
    """times_ns: (N,). values: (N,)."""

    times_ns: Int64
    values: Float64

    def within(self, window: Window) -> Series:
        inside = window.holds(self.times_ns)
        return Series(self.times_ns[inside], self.values[inside])

    def mean(self, from_ns: int, to_ns: int) -> float:
        """From one time to another, both included; NaN where nothing is known."""
        chosen = self.values[(self.times_ns >= from_ns) & (self.times_ns <= to_ns)]
        return float(chosen.mean()) if len(chosen) else float("nan")


@dataclass(frozen=True)
class Effect:
    """One figure of a vehicle.

    key: in `report.json`. digits: to print of it. is_by_cloud: known of single clouds, nothing lies between.
    """

    key: str
    title: str
    digits: int
    clean: Series
    attacked: Series
    is_by_cloud: bool = False


def effects(clean: BagReader, bag: Path, vehicle: str, window: Window = WHOLE_DRIVE) -> Iterator[Effect]:
    """Of its estimate, its map and its clouds in a window, those that both bags tell of."""
    reader, topics = BagReader(bag), VehicleTopics(vehicle)
    needed = {
        _own_place: (topics.odometry.name, topics.true_odometry.name),
        _map: (topics.ldm.name, V2X_STATIONS.name),
    }
    for measure, key, title, digits in (
        (_own_place, "own_place_m", "takes itself to be off by [m]", 2),
        (_map, "map_wrong", "wrong in its map: false, missing, displaced", 1),
    ):
        if all(name in one.topics for one in (clean, reader) for name in needed[measure]):
            before, after = (measure(one, vehicle, window).within(window) for one in (clean, reader))
            yield Effect(key, title, digits, before, after)
    if counts := touched_points(bag, vehicle):
        touched = _series(counts).within(window)
        none = Series(touched.times_ns, np.zeros(len(touched.values)))
        yield Effect("points_touched", "points touched in a cloud", 0, none, touched, True)


def _own_place(reader: BagReader, vehicle: str, window: Window) -> Series:
    topics = VehicleTopics(vehicle)
    true = poses(reader, topics.true_odometry.name, window.last_ns)
    told = poses(reader, topics.odometry.name, window.last_ns)
    return _series(
        {ns: float(np.linalg.norm((told[ns] - true[ns])[:2, 3])) for ns in told.keys() & true.keys()}
    )


def _map(reader: BagReader, vehicle: str, window: Window) -> Series:
    expiry_s = read_recording(reader, window.end_ns).expiry_s
    found = ldm_error(moments(reader, vehicle, expiry_s, window))
    return Series(found.time_ns, found.false_entries + found.missing + found.displaced)


def _series(values: dict[int, float] | dict[int, int]) -> Series:
    times_ns = sorted(values)
    return Series(np.array(times_ns, np.int64), np.array([values[ns] for ns in times_ns], np.float64))
