"""What relays the messages of one family of attacks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from advpipe.pipeline.campaigns.relay.counts import RelayCounts
from advpipe.pipeline.campaigns.relay.outgoing import OutgoingMessage
from advpipe.pipeline.mcap.channel import Topic


class RelayPart(Protocol):
    """topics: those that it sends; it takes the messages of the first one, whose counts these are."""

    counts: RelayCounts
    topics: tuple[Topic, ...]

    def begin(self, start_ns: int) -> None:
        """Schedules count from here."""

    def take(self, cdr: bytes, now_ns: int, arrival_s: float) -> None:
        """A message that has come, at a time of the graph and of the monotonic clock."""

    def due(self, now_ns: int, now_s: float) -> Iterator[OutgoingMessage]:
        """What is to be sent by now."""

    def end(self) -> None:
        """Nothing is sent any more."""
