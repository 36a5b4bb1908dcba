"""What became of the messages of one topic."""

from __future__ import annotations

from collections import Counter

from advpipe.pipeline.campaigns.relay.outgoing import ADDED_BY_ATTACK, ATTACKED, LATE
from advpipe.pipeline.campaigns.relay.summary import RelayedTopic
from advpipe.pipeline.live.lateness import Lateness


class RelayCounts:
    """latency: from the arrival of a message to when it was handed to DDS again."""

    def __init__(self) -> None:
        self.received = 0
        self.withheld = 0
        self.fates: Counter[str] = Counter()
        self.not_taken = 0
        self.latency = Lateness()

    def row(self, topic: str, published: str, missed: int) -> RelayedTopic:
        """The counts so far. missed: by slow subscribers, beside those that were not taken at all."""
        return RelayedTopic(
            topic=topic,
            published=published,
            received=self.received,
            sent=self.fates.total(),
            attacked=self.fates[ATTACKED],
            added=self.fates[ADDED_BY_ATTACK],
            late=self.fates[LATE],
            withheld=self.withheld,
            missed=self.not_taken + missed,
            latency_median_ms=self.latency.percentile_s(50) * 1e3,
            latency_p99_ms=self.latency.percentile_s(99) * 1e3,
            latency_max_ms=self.latency.max_s * 1e3,
        )
