"""The debug topics of an adversarial bag, from which viewers show what the attack did."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.touched_points import touched_by
from advpipe.pipeline.mcap.channel import RawMessage, StampedCdr, Topic
from advpipe.pipeline.messages.cloud import StampedCloud
from advpipe.pipeline.messages.debug import (
    MOST_CLAIMS,
    ClaimedPosition,
    positions_cdr,
    positions_topic,
    touched_points_cdr,
    touched_points_topic,
)
from advpipe.pipeline.messages.topics import V2X_SENT
from advpipe.pipeline.messages.types import schema_text, type_hash
from advpipe.stages.attack.lidar.base import LidarResult


class DebugMessages:
    """Debug messages on their way into the bag; those added while others are merged must not be older."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, RawMessage]] = []
        self._counts: Counter[str] = Counter()

    def add(self, topic: Topic, cdr: bytes, log_time_ns: int) -> None:
        """Add a message, which `merged` yields after all others of its log time."""
        full = replace(topic, type_hash=type_hash(topic.type))
        sequence = self._counts[topic.name]
        message = RawMessage(full, schema_text(topic.type), cdr, log_time_ns, log_time_ns, sequence)
        heapq.heappush(self._waiting, (log_time_ns, self._counts.total(), message))
        self._counts[topic.name] += 1

    def merged(self, messages: Iterable[RawMessage]) -> Iterator[RawMessage]:
        """The messages, in log-time order, and the debug messages, which consuming them may add."""
        for raw in messages:
            while self._waiting and self._waiting[0][0] < raw.log_time_ns:
                yield heapq.heappop(self._waiting)[2]
            yield raw
        while self._waiting:
            yield heapq.heappop(self._waiting)[2]


def touched_cloud(lidar_topic: str, clean: StampedCloud, result: LidarResult) -> tuple[Topic, bytes]:
    """The points that an attack touched in one cloud: same stamp and frame, see `TOUCHED_POINT_DTYPE`."""
    points = touched_by(CloudChange(clean.cloud, result.cloud, result.labels))
    cdr = touched_points_cdr(points, clean.stamp_ns, clean.frame_id)
    return touched_points_topic(lidar_topic), cdr


def claims_message(claims: Sequence[tuple[int, ClaimedPosition]]) -> StampedCdr | None:
    """The positions that the touched messages of a step claim, with the times of the messages; None without.

    A later claim of the same id replaces an earlier one.
    """
    if not claims:
        return None
    newest = {claim.id: claim for _, claim in claims}
    stamp_ns = max(time_ns for time_ns, _ in claims)
    shown = list(newest.values())[-MOST_CLAIMS:]
    return positions_topic(V2X_SENT.name), positions_cdr(stamp_ns, shown), stamp_ns
