"""Where a vehicle was, where its receiver said it was, and where its filter took it to be."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.localisation import read_measurements
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import Window
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.replay.recorded_filter import filter_errors, read_filter

Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class LocalisationTrack:
    """One vehicle in one bag, at the K times of its estimates.

    times_ns: (K,). true_m, true_ahead: (K, 3), its true place in the map and the direction of its x axis.
    fix_m: (K, 3), NaN between fixes and without one. estimate_m: (K, 3). nis: (K,), the normalised
    innovation squared of each fix, NaN without one.
    """

    times_ns: npt.NDArray[np.int64]
    true_m: Float64
    true_ahead: Float64
    fix_m: Float64
    estimate_m: Float64
    nis: Float64

    def within(self, window: Window) -> LocalisationTrack:
        """The steps in a window."""
        inside = window.holds(self.times_ns)
        return LocalisationTrack(**{each.name: getattr(self, each.name)[inside] for each in fields(self)})

    @property
    def error_m(self) -> Float64:
        """Estimate minus truth (K, 3), not aligned: alignment would hide a bias."""
        error: Float64 = self.estimate_m - self.true_m
        return error

    @property
    def lateral_m(self) -> Float64:
        """The horizontal error across the true direction (K,), positive to the left."""
        ahead = self.true_ahead[:, :2] / np.linalg.norm(self.true_ahead[:, :2], axis=1, keepdims=True)
        lateral: Float64 = ahead[:, 0] * self.error_m[:, 1] - ahead[:, 1] * self.error_m[:, 0]
        return lateral


def read_track(reader: BagReader, vehicle: str, last_ns: int | None = None) -> LocalisationTrack:
    """The vehicle's own filter run again on what the bag holds of its sensors, up to `last_ns`.

    Raises AdvpipeError for a bag without its true poses, or from which its filter cannot be run.
    """
    with filter_errors(reader, vehicle):
        return _read_track(reader, vehicle, last_ns)


def _read_track(reader: BagReader, vehicle: str, last_ns: int | None) -> LocalisationTrack:
    topics = VehicleTopics(vehicle)
    truth = {
        time_ns: build.se3_from_pose(message.pose.pose)
        for time_ns, message in reader.messages(topics.true_odometry.name, last_ns)
    }
    recorded = read_filter(reader)
    estimator, geodesy = recorded.estimator(reader, topics), recorded.geodesy
    times_ns, true_m, ahead, fixes, estimates, squares = [], [], [], [], [], []
    for measured in read_measurements(reader, topics, last_ns):
        estimate = estimator.step(measured)
        if measured.stamp_ns not in truth:
            raise AdvpipeError(
                f"{reader.path}: {topics.true_odometry.name} has no pose at {measured.stamp_ns} ns, when "
                f"{topics.odometry.name} has one; record it again"
            )
        map_SE3_base = truth[measured.stamp_ns]
        times_ns.append(measured.stamp_ns)
        true_m.append(map_SE3_base[:3, 3])
        ahead.append(map_SE3_base[:3, 0])
        fixes.append(np.full(3, np.nan) if measured.fix is None else geodesy.to_map(measured.fix))
        estimates.append(estimate.map_SE3_base[:3, 3])
        squares.append(np.nan if estimate.innovation is None else estimate.innovation.nis)
    return LocalisationTrack(
        times_ns=np.array(times_ns, dtype=np.int64),
        true_m=np.array(true_m).reshape(-1, 3),
        true_ahead=np.array(ahead).reshape(-1, 3),
        fix_m=np.array(fixes).reshape(-1, 3),
        estimate_m=np.array(estimates).reshape(-1, 3),
        nis=np.array(squares, dtype=np.float64),
    )


def attacked_fixes_ns(
    clean: BagReader, adversarial: BagReader, vehicle: str, last_ns: int | None = None
) -> npt.NDArray[np.int64]:
    """Log times (A,) of a vehicle's fixes that say something else than in the clean bag, or nothing more.

    Of those up to `last_ns`.
    """
    before, after = _fixes(clean, vehicle, last_ns), _fixes(adversarial, vehicle, last_ns)
    changed = [
        time_ns
        for time_ns in sorted(before.keys() & after.keys())
        if not np.array_equal(before[time_ns], after[time_ns], equal_nan=True)
    ]
    return np.array(changed, dtype=np.int64)


def _fixes(reader: BagReader, vehicle: str, last_ns: int | None) -> dict[int, Float64]:
    """By log time: status, latitude, longitude, altitude."""
    return {
        time_ns: np.array([fix.status.status, fix.latitude, fix.longitude, fix.altitude])
        for time_ns, fix in reader.messages(VehicleTopics(vehicle).gnss_fix.name, last_ns)
    }
