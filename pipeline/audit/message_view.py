"""Received messages as probes see them: when they came, how long they are, and which id they claim."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.audit.probe import Float64
from advpipe.pipeline.bag.receptions import RecordedReception
from advpipe.pipeline.v2x.codec.timestamps import GENERATION_DELTA_TIME_CYCLE_MS, generation_delta_time_ms

Int64 = npt.NDArray[np.int64]

HEADER_BYTES, TIME_BYTES = 6, 8
"""Of a CAM in UPER: version, type and station id; the time of generation follows."""

CHECK_S = 0.1
"""Between checks whether to send a CAM; intervals are multiples of it."""


@dataclass(frozen=True)
class MessageView:
    """The N messages of one type that a vehicle received, by arrival; `lag_s` and `same_body` are of CAMs."""

    receptions: Sequence[RecordedReception]

    @cached_property
    def arrival_ns(self) -> Int64:
        """When (N,) they arrived."""
        return np.array([each.arrival_ns for each in self.receptions], np.int64)

    @cached_property
    def station(self) -> Int64:
        """The station id (N,) that each claims; -1 for what is too short to claim one."""
        return np.array([_number(each.payload, 2, HEADER_BYTES) for each in self.receptions], np.int64)

    @cached_property
    def length(self) -> Float64:
        """Bytes (N,) of each."""
        return np.array([len(each.payload or b"") for each in self.receptions], np.float64)

    @cached_property
    def interval_s(self) -> Float64:
        """The time (N,) since the last message of the same id; NaN for its first."""
        found = np.full(len(self.station), np.nan)
        for places in self.of_station:
            found[places[1:]] = np.diff(self.arrival_ns[places]) / 1e9
        return found

    @cached_property
    def of_station(self) -> list[Int64]:
        """The messages of each id, by index."""
        order = np.argsort(self.station, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(self.station[order])) + 1) if len(order) else []

    @cached_property
    def rate_hz(self) -> Float64:
        """How many messages (N,) the same id sent in the second that ends with each."""
        found = np.zeros(len(self.station))
        for places in self.of_station:
            times = self.arrival_ns[places]
            found[places] = np.arange(1, len(places) + 1) - np.searchsorted(
                times, times - 1_000_000_000, "right"
            )
        return found

    @cached_property
    def age_s(self) -> Float64:
        """How long (N,) the id has been heard."""
        found = np.zeros(len(self.station))
        for places in self.of_station:
            found[places] = (self.arrival_ns[places] - self.arrival_ns[places[0]]) / 1e9
        return found

    @cached_property
    def lag_s(self) -> Float64:
        """From the stated time of generation (N,) to the arrival; NaN for a message without one."""
        stated = np.array([_number(each.payload, HEADER_BYTES, TIME_BYTES) for each in self.receptions])
        arrived = np.array([generation_delta_time_ms(each) for each in self.arrival_ns.tolist()])
        half = GENERATION_DELTA_TIME_CYCLE_MS // 2
        lag_ms = (arrived - stated + half) % GENERATION_DELTA_TIME_CYCLE_MS - half
        return np.where(stated < 0, np.nan, lag_ms / 1e3)

    @cached_property
    def gap_s(self) -> Float64:
        """The time (N,) to the nearest message of another arrival, before or after."""
        step = np.diff(self.arrival_ns) / 1e9
        nearest: Float64 = np.fmin(np.append(np.inf, step), np.append(step, np.inf))
        return nearest

    @cached_property
    def same_body(self) -> Float64:
        """How many messages (N,) have the same bytes behind header and time."""
        bodies = [(each.payload or b"")[TIME_BYTES:] for each in self.receptions]
        count = Counter(bodies)
        return np.array([count[body] for body in bodies], np.float64)


@dataclass(frozen=True)
class StationView:
    """The S ids that a vehicle heard, each with its messages."""

    messages: MessageView

    def each(self, values: Float64) -> Float64:
        """The median (S,) of values (N,) of the messages of each id; NaN where there are none."""
        return self._of(values, np.nanmedian)

    def spread(self, values: Float64) -> Float64:
        """The same of their standard deviation."""
        return self._of(values, np.nanstd)

    @property
    def count(self) -> Float64:
        """How many messages (S,) each sent."""
        return np.array([len(places) for places in self.messages.of_station], np.float64)

    def _of(self, values: Float64, of: Callable[[Float64], Any]) -> Float64:
        found = [values[places] for places in self.messages.of_station]
        return np.array([of(own) if np.isfinite(own).any() else np.nan for own in found], np.float64)


def _number(payload: bytes | None, start: int, end: int) -> int:
    """A whole number, big-endian; -1 where the message is too short."""
    if payload is None or len(payload) < end:
        return -1
    return int.from_bytes(payload[start:end], "big")
