"""Metrics of the radio channel: delivery and load of a drive, and delivery of honest messages."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

from advpipe.pipeline.results.v2x import RadioMetrics
from advpipe.pipeline.v2x.statistics import BIN_M, Statistics
from advpipe.stages.evaluate.v2x.receptions import NEAR_M, ListenerReceptions


def radio_metrics(statistics: Statistics | None) -> RadioMetrics | None:
    """The metrics of one bag; None for a bag without statistics."""
    if statistics is None:
        return None
    bins = round(NEAR_M / BIN_M)
    pairs, received = sum(statistics.pairs[:bins]), sum(statistics.received[:bins])
    busy = statistics.busy_mean
    return RadioMetrics(
        statistics.cams,
        statistics.dropped,
        received / pairs if pairs else math.nan,
        sum(busy) / len(busy) if busy else math.nan,
        max(statistics.busy_max, default=math.nan),
        statistics.delay_mean_s,
    )


class MessageNumbers(NamedTuple):
    """Numbers of messages that others sent within `NEAR_M` of a listener, and of all that it received."""

    near: frozenset[int]
    received: frozenset[int]

    @classmethod
    def of(cls, receptions: ListenerReceptions) -> MessageNumbers:
        """The numbers of the messages sent near a listener, and of those that it received."""
        return cls(receptions.near, frozenset(n for n in receptions.numbers if n is not None))

    def delivered(self, numbers: Collection[int]) -> float:
        """The share of these messages that the listener received; NaN without any."""
        return len(self.received.intersection(numbers)) / len(numbers) if numbers else math.nan
