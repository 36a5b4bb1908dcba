"""What attacks do to the radio channel: delivery and load of a bag's drive, from its recorded statistics."""

from __future__ import annotations

import math
from dataclasses import dataclass

from advpipe.pipeline.v2x.statistics import BIN_M, Statistics

NEAR_M = 300.0


@dataclass(frozen=True)
class RadioRow:
    """Messages sent and never sent, the share of pairs of message and receiver within `NEAR_M` that is
    delivered, channel busy ratios over stations and time, mean delay."""

    cams: int
    dropped: int
    delivered: float
    busy_mean: float
    busy_max: float
    delay_s: float


def radio_row(statistics: Statistics | None) -> RadioRow | None:
    """The line of one bag; None for one that holds no statistics."""
    if statistics is None:
        return None
    bins = round(NEAR_M / BIN_M)
    pairs, received = sum(statistics.pairs[:bins]), sum(statistics.received[:bins])
    busy = statistics.busy_mean
    return RadioRow(
        statistics.cams,
        statistics.dropped,
        received / pairs if pairs else math.nan,
        sum(busy) / len(busy) if busy else math.nan,
        max(statistics.busy_max, default=math.nan),
        statistics.delay_mean_s,
    )
