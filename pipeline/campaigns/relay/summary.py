"""What a relay did."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted


@dataclass(frozen=True)
class RelayedTopic:
    """What became of a topic's messages; latency: from arrival to when they were handed to DDS again.

    late: sent unchanged since the machine did not keep up. withheld: dropped by an attack, held back by one
    to the end, or dropped for being late. missed: by slow subscribers, at least, as they acknowledge.
    """

    topic: str
    published: str
    received: int
    sent: int
    attacked: int
    added: int
    late: int
    withheld: int
    missed: int
    latency_median_ms: float
    latency_p99_ms: float
    latency_max_ms: float

    def __str__(self) -> str:
        parts = {
            "attacked": self.attacked,
            "added": self.added,
            "late and so unchanged": self.late,
            "withheld": self.withheld,
            "or more missed by slow subscribers": self.missed,
        }
        counts = "".join(f", {count:,} {word}" for word, count in parts.items() if count)
        return (
            f"{self.published}: {self.received:,} in, {self.sent:,} out{counts}; latency "
            f"{self.latency_median_ms:.1f} ms (median), {self.latency_p99_ms:.1f} ms (99 %), "
            f"{self.latency_max_ms:.1f} ms (most)"
        )


@dataclass(frozen=True, repr=False)
class RelaySummary(Tabular):
    """A line a topic, and the bag.

    unrecorded: what the disk was too slow for. cpu_s: processor time while it relayed. reason: why it ended.
    """

    bag: Path
    topics: tuple[RelayedTopic, ...]
    recorded: int
    unrecorded: int
    seconds: float
    cpu_s: float
    reason: str

    def __str__(self) -> str:
        lost = f"; {self.unrecorded:,} not recorded, as the disk is too slow" if self.unrecorded else ""
        recorded = f"{counted(self.recorded, 'message')} recorded in {self.seconds:.1f} s"
        cpu = f"{self.cpu_s:.1f} s of processor time"
        return "\n".join([*map(str, self.topics), f"{self.bag}: {recorded} ({cpu}), {self.reason}{lost}"])

    def to_dicts(self) -> Rows:
        """One row a topic."""
        return [dict(vars(topic)) for topic in self.topics]
