"""The effects of attacks of several families on one vehicle over time, in the clean bag and the attacked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import WHOLE_DRIVE, Window
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.topics import V2X_STATIONS, VehicleTopics
from advpipe.pipeline.results.frame_row import FrameRow
from advpipe.stages.evaluate.cooperative.pair import poses
from advpipe.stages.evaluate.coordinated.attack_timeline import Int64, touched_points, touched_returns
from advpipe.stages.evaluate.v2x.ldm_error import ldm_error, moments
from advpipe.stages.evaluate.v2x.recording import read_recording


@dataclass(frozen=True)
class Series:
    """times_ns: (N,). values: (N,)."""

    times_ns: Int64
    values: Float64

    def within(self, window: Window) -> Series:
        """The values whose times are in a window."""
        inside = window.holds(self.times_ns)
        return Series(self.times_ns[inside], self.values[inside])

    def mean(self, from_ns: int, to_ns: int) -> float:
        """The mean from one time to another, both included; NaN where there is no value."""
        chosen = self.values[(self.times_ns >= from_ns) & (self.times_ns <= to_ns)]
        return float(chosen.mean()) if len(chosen) else float("nan")


@dataclass(frozen=True)
class Effect:
    """One measure of a vehicle.

    key: in `report.json`. short_title: in two lines, for a picture. digits: printed after the point.
    is_by_cloud: known for single clouds only.
    """

    key: str
    title: str
    short_title: str
    digits: int
    clean: Series
    attacked: Series
    is_by_cloud: bool = False


@dataclass(frozen=True)
class DetectedFrames:
    """What a detector found in the clouds of a vehicle, clean and attacked."""

    vehicle: str
    frames: Sequence[FrameRow]


def effects(
    clean: BagReader,
    bag: Path,
    vehicle: str,
    window: Window = WHOLE_DRIVE,
    detected: DetectedFrames | None = None,
) -> Iterator[Effect]:
    """The effects on a vehicle's position estimate, map and clouds in a window, if both bags record them.

    detected: in the clouds of the bag, for the objects that the detector misses.
    """
    reader, topics = BagReader(bag), VehicleTopics(vehicle)
    needed = {
        _position_error: (topics.odometry.name, topics.true_odometry.name),
        _wrong_entries: (topics.ldm.name, V2X_STATIONS.name),
    }
    for measure, key, title, short, digits in (
        (
            *(_position_error, "own_place_m", "error of the position estimate [m]"),
            *("error of the position\nestimate [m]", 2),
        ),
        (
            *(_wrong_entries, "map_wrong", "wrong LDM entries: false, missing or displaced"),
            *("wrong entries of the\nLocal Dynamic Map", 1),
        ),
    ):
        if all(name in one.topics for one in (clean, reader) for name in needed[measure]):
            before, after = (measure(one, vehicle, window).within(window) for one in (clean, reader))
            yield Effect(key, title, short, digits, before, after)
    if counts := touched_points(bag, vehicle):
        touched = _series(counts).within(window)
        none = Series(touched.times_ns, np.zeros(len(touched.values)))
        title, short = "points changed per cloud", "points changed\nper cloud"
        yield Effect("points_touched", title, short, 0, none, touched, True)
    if changed := touched_returns(bag, vehicle):
        touched = _series(changed).within(window)
        none = Series(touched.times_ns, np.zeros(len(touched.values)))
        title, short = "radar returns changed per scan", "radar returns\nchanged per scan"
        yield Effect("returns_touched", title, short, 0, none, touched, True)
    if detected is not None and detected.vehicle == vehicle:
        before, after = (_missed(detected.frames, condition).within(window) for condition in ("clean", "adv"))
        title, short = "evaluated objects missed per cloud", "evaluated objects\nmissed per cloud"
        yield Effect("objects_missed", title, short, 1, before, after, True)


@dataclass(frozen=True)
class BelievedTrack:
    """Where a vehicle was and where it believed to be, in the map frame.

    times_ns: (N,), ascending. true_m, believed_m: (N, 2).
    """

    times_ns: Int64
    true_m: Float64
    believed_m: Float64


def believed_track(bag: Path, vehicle: str, window: Window = WHOLE_DRIVE) -> BelievedTrack | None:
    """The track of a vehicle in a bag in a window; None where the bag records it at fewer than two times."""
    reader, topics = BagReader(bag), VehicleTopics(vehicle)
    names = topics.true_odometry.name, topics.odometry.name
    if not all(name in reader.topics for name in names):
        return None
    true, believed = (poses(reader, name, window.last_ns) for name in names)
    times_ns = np.array(sorted(true.keys() & believed.keys()), np.int64)
    times_ns = times_ns[window.holds(times_ns)]
    if len(times_ns) < 2:
        return None
    tracks = (np.array([found[ns][:2, 3] for ns in times_ns.tolist()]) for found in (true, believed))
    return BelievedTrack(times_ns, *tracks)


def _missed(frames: Sequence[FrameRow], condition: str) -> Series:
    """The evaluated objects of each frame that the detector does not find, at loose overlap."""
    clouds = {row.stamp_ns: (row.objects, row.clouds.get(condition)) for row in frames}
    return _series({ns: count - cloud.found_objects for ns, (count, cloud) in clouds.items() if cloud})


def _position_error(reader: BagReader, vehicle: str, window: Window) -> Series:
    topics = VehicleTopics(vehicle)
    true = poses(reader, topics.true_odometry.name, window.last_ns)
    reported = poses(reader, topics.odometry.name, window.last_ns)
    return _series(
        {ns: float(np.linalg.norm((reported[ns] - true[ns])[:2, 3])) for ns in reported.keys() & true.keys()}
    )


def _wrong_entries(reader: BagReader, vehicle: str, window: Window) -> Series:
    expiry_s = read_recording(reader, window.end_ns).expiry_s
    found = ldm_error(moments(reader, vehicle, expiry_s, window))
    return Series(found.time_ns, found.false_entries + found.missing + found.displaced)


def _series(values: dict[int, float] | dict[int, int]) -> Series:
    times_ns = sorted(values)
    return Series(np.array(times_ns, np.int64), np.array([values[ns] for ns in times_ns], np.float64))
