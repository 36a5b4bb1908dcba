"""GNSS fixes as probes see them, and the probes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.audit.probe import Float64, Probe


@dataclass(frozen=True)
class FixView:
    """The N fixes of a vehicle, in order: messages (sensor_msgs/NavSatFix), their stamps and log times."""

    messages: Sequence[Any]
    stamp_ns: npt.NDArray[np.int64]
    log_time_ns: npt.NDArray[np.int64]

    @cached_property
    def values(self) -> Float64:
        """Latitude and longitude in degrees and altitude in metres (N, 3)."""
        rows = [(each.latitude, each.longitude, each.altitude) for each in self.messages]
        return np.array(rows, np.float64).reshape(-1, 3)

    @cached_property
    def interval_s(self) -> Float64:
        """The time (N,) since the fix before."""
        return np.append(np.nan, np.diff(self.stamp_ns) / 1e9)

    @cached_property
    def roundness(self) -> Float64:
        """How many bits at the end of the latitude, longitude and altitude (N,) are zero."""
        bits = np.ascontiguousarray(self.values).view(np.uint64)
        low = (bits & (~bits + np.uint64(1))).astype(np.float64)
        zeros: Float64 = np.where(bits == 0, 52.0, np.log2(np.maximum(low, 1.0))).sum(axis=1)
        return zeros

    @cached_property
    def variance_m2(self) -> Float64:
        """The trace (N,) of the stated covariance."""
        rows = [np.asarray(each.position_covariance, np.float64)[[0, 4, 8]].sum() for each in self.messages]
        return np.array(rows, np.float64)


FIX_PROBES: tuple[Probe[FixView], ...] = (
    Probe("interval", "fix", "deviation of the interval from the usual one",
          lambda v: np.abs(v.interval_s - np.nanmedian(v.interval_s))),
    Probe("log-time", "fix", "log time after the stamp", lambda v: (v.log_time_ns - v.stamp_ns) / 1e9),
    Probe("digits", "fix", "zero bits at the end of the numbers", lambda v: v.roundness),
    Probe("covariance", "fix", "stated variance", lambda v: v.variance_m2),
    Probe("covariance-type", "fix", "stated type of the covariance",
          lambda v: np.array([each.position_covariance_type for each in v.messages], np.float64)),
    Probe("status", "fix", "stated status",
          lambda v: np.array([each.status.status for each in v.messages], np.float64)),
    Probe("order", "fix", "place among all fixes",
          lambda v: np.arange(len(v.messages)) / max(len(v.messages), 1)),
)  # fmt: skip
