"""What attacks do to the radio channel: delivery and load of a drive, and delivery of honest messages."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

from advpipe.pipeline.v2x.statistics import BIN_M, Statistics
from advpipe.stages.evaluate.v2x.receptions import NEAR_M, Receptions


@dataclass(frozen=True)
class RadioRow:
    """Messages sent and never sent, of everybody, attackers included; the share of pairs of such a message
    and a receiver within `NEAR_M` that is delivered; channel busy ratios over stations and time; mean delay.

    Of whole drives: bags tell of no single pair.
    """

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


class Heard(NamedTuple):
    """Numbers of messages: what others sent within `NEAR_M` of a listener, and what it received at all."""

    near: frozenset[int]
    received: frozenset[int]

    @classmethod
    def of(cls, receptions: Receptions) -> Heard:
        return cls(receptions.near, frozenset(n for n in receptions.numbers if n is not None))

    def delivered(self, numbers: Collection[int]) -> float:
        """The share of these messages that it received; NaN of none."""
        return len(self.received.intersection(numbers)) / len(numbers) if numbers else math.nan
