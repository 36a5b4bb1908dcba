"""What was played."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.live.publisher import missed_in_words


@dataclass(frozen=True)
class PlayedTopic:
    """A topic, the messages that were sent, and how many of them slow ROS 2 subscribers missed, at least."""

    topic: str
    type: str
    messages: int = 0
    missed: int = 0


@dataclass(frozen=True, repr=False)
class PlaySummary(Tabular):
    """What was played, and how late messages were against the recorded rate, in milliseconds.

    recorded_s: recorded seconds, of all loops together. missed_uncounted: whether a Foxglove viewer was too
    slow.
    """

    bag: Path
    topics: tuple[PlayedTopic, ...]
    loops: int
    recorded_s: float
    late_median_ms: float
    late_p99_ms: float
    late_max_ms: float
    missed_uncounted: bool = False

    @property
    def messages(self) -> int:
        """Messages that were sent, of all topics."""
        return sum(topic.messages for topic in self.topics)

    @property
    def missed(self) -> int:
        """Messages that slow ROS 2 subscribers missed, at least: they left the history unacknowledged."""
        return sum(topic.missed for topic in self.topics)

    def __str__(self) -> str:
        rounds = f" in {counted(self.loops, 'loop')}" if self.loops > 1 else ""
        return (
            f"{self.bag}: {counted(self.messages, 'message')} on {counted(len(self.topics), 'topic')}, "
            f"{self.recorded_s:.1f} recorded seconds{rounds}; late by {self.late_median_ms:.1f} ms (median), "
            f"{self.late_p99_ms:.1f} ms (99 %), {self.late_max_ms:.1f} ms (most); "
            f"{missed_in_words(self.missed, self.missed_uncounted)}"
        )

    def to_dicts(self) -> Rows:
        """One row a topic."""
        return [dict(vars(topic)) for topic in self.topics]
