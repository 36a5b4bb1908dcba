"""One vehicle's localisation under attack: its spoofed fixes, and its filter run again on them."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from advpipe.pipeline.bag.localisation import read_initial_pose, read_measurements
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64, yaw_of
from advpipe.pipeline.localisation.estimate import Estimate, Innovation
from advpipe.pipeline.localisation.estimator import Estimator
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.measurements import Measurements
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.replay.recorded_filter import RecordedFilter, filter_errors
from advpipe.stages.attack.gnss.spoofing_schedule import FalseFix, SpoofingSchedule

NO_FIX = -1
COVARIANCE_UNKNOWN = 0


@dataclass(frozen=True)
class FixRecord:
    """One fix before and after: latitude and longitude in degrees, altitude in metres (3,), or None.

    covariance_m2: (3, 3) east, north, up, that the receiver states. position_m: (3,) in the map.
    """

    stamp_ns: int
    true_geographic: Float64 | None
    true_m: Float64 | None
    covariance_m2: Float64
    false_fix: FalseFix | None
    reported: Float64 | None

    @property
    def is_false(self) -> bool:
        """Whether the fix was changed; an active attack may leave it as it was."""
        return self.reported is not self.true_geographic


@dataclass(frozen=True)
class SpoofedVehicle:
    """A victim after the attack. fixes: its messages. records: one for each. estimates: by log time."""

    vehicle: str
    attack: str
    fixes: tuple[RawMessage, ...]
    records: tuple[FixRecord, ...]
    estimates: dict[int, Estimate]

    @property
    def first_attacked_ns(self) -> int | None:
        """Stamp of the first attacked fix; None without any."""
        return next((record.stamp_ns for record in self.records if record.false_fix is not None), None)


def spoof_vehicle(reader: BagReader, recorded: RecordedFilter, schedule: SpoofingSchedule) -> SpoofedVehicle:
    """Runs the victim's filter on the recording again; without a false fix, it reproduces every bit."""
    with filter_errors(reader, schedule.victim):
        return _spoof_vehicle(reader, recorded, schedule)


def _spoof_vehicle(reader: BagReader, recorded: RecordedFilter, schedule: SpoofingSchedule) -> SpoofedVehicle:
    topics, geodesy = VehicleTopics(schedule.victim), recorded.geodesy
    estimator = recorded.estimator(reader, topics)
    waiting = reader.raw_messages([topics.gnss_fix.name])
    raw = next(waiting, None)
    heading_rad = yaw_of(read_initial_pose(reader, topics).map_SE3_base)
    fixes: list[RawMessage] = []
    records: list[FixRecord] = []
    estimates: dict[int, Estimate] = {}
    for measured in read_measurements(reader, topics):
        while raw is not None and raw.log_time_ns <= measured.stamp_ns:
            predict_innovation = _innovation_predictor(estimator, measured)
            fix, record = spoof_fix(
                raw, reader.decode(raw), schedule, geodesy, heading_rad, predict_innovation
            )
            fixes.append(fix)
            records.append(record)
            measured = replace(measured, fix=record.reported)
            raw = next(waiting, None)
        estimate = estimator.step(measured)
        if estimate.innovation is not None:
            schedule.observe(estimate.innovation)
        estimates[measured.stamp_ns] = estimate
        heading_rad = yaw_of(estimate.map_SE3_base)
    while raw is not None:  # after the last estimate: without any effect
        fixes.append(raw)
        raw = next(waiting, None)
    return SpoofedVehicle(schedule.victim, schedule.name, tuple(fixes), tuple(records), estimates)


def _innovation_predictor(estimator: Estimator, measured: Measurements) -> Callable[[Float64], Innovation]:
    """Computes the innovation of a fix in this step, without changing the filter."""

    def predict_innovation(fix: Float64) -> Innovation:
        innovation = deepcopy(estimator).step(replace(measured, fix=fix)).innovation
        assert innovation is not None
        return innovation

    return predict_innovation


def spoof_fix(
    raw: RawMessage,
    message: Any,
    schedule: SpoofingSchedule,
    geodesy: Geodesy,
    heading_rad: float,
    predict_innovation: Callable[[Float64], Innovation],
) -> tuple[RawMessage, FixRecord]:
    """The fix that the schedule makes of a true one, and what was done; the message itself where nothing
    was."""
    stamp_ns = build.stamp_ns(message)
    covariance_m2 = np.array(message.position_covariance, dtype=np.float64).reshape(3, 3)
    true_geographic = np.array([message.latitude, message.longitude, message.altitude])
    if message.status.status < 0 or not np.isfinite(true_geographic).all():
        return raw, FixRecord(stamp_ns, None, None, covariance_m2, None, None)
    true_m = geodesy.to_map(true_geographic)
    false_fix = schedule.of(raw.log_time_ns, true_m, heading_rad, lambda: predict_innovation(true_geographic))
    if false_fix is None or (
        false_fix.position_m is not None and np.array_equal(false_fix.position_m, true_m)
    ):
        return raw, FixRecord(stamp_ns, true_geographic, true_m, covariance_m2, false_fix, true_geographic)
    reported = None if false_fix.position_m is None else geodesy.to_geographic(false_fix.position_m)
    spoofed = replace(raw, cdr=serialise(_with_position(message, reported), raw.topic.type))
    return spoofed, FixRecord(stamp_ns, true_geographic, true_m, covariance_m2, false_fix, reported)


def _with_position(message: Any, reported: Float64 | None) -> Any:
    """The fix at another position, with the receiver's stated accuracy; or without a fix for None."""
    if reported is None:
        return replace(
            message,
            status=replace(message.status, status=NO_FIX),
            latitude=float("nan"),
            longitude=float("nan"),
            altitude=float("nan"),
            position_covariance=np.zeros(9),
            position_covariance_type=COVARIANCE_UNKNOWN,
        )
    latitude_deg, longitude_deg, altitude_m = reported.tolist()
    return replace(message, latitude=latitude_deg, longitude=longitude_deg, altitude=altitude_m)
