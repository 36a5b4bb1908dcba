"""The relay's ends in a ROS 2 graph: it subscribes to what is published, and publishes it under a prefix."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.campaigns.relay.options import RelayOptions
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.text import one_line
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.live.dds_types import dds_type_name
from advpipe.pipeline.live.offered_qos import offered_qos
from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.live.ros2 import Ros2Publisher
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.live.ros2_subscriber import GraphPublisher, Ros2Subscriber
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import keep_last
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import schema_text

NODE_NAME = "advpipe_relay"
_PATIENCE_S = 3.0


class RelayGraph:
    """Topics are subscribed to, and their counterparts announced, as soon as somebody publishes them.

    groups: topics that belong together; the first of each is subscribed to, all of them are published.
    """

    def __init__(self, options: RelayOptions, groups: Sequence[tuple[Topic, ...]]) -> None:
        assert options.domain is not None
        node = Ros2Node(options.domain, options.interface, NODE_NAME)
        self._options = options
        self._subscriber, self._publisher = Ros2Subscriber(node), Ros2Publisher(node)
        self._missing = {group[0].name: group for group in groups}
        self._has_clock = False
        self._patience_s = time.monotonic() + _PATIENCE_S

    @property
    def has_clock(self) -> bool:
        """Whether somebody publishes /clock."""
        return self._has_clock

    def join(self) -> None:
        """Subscribe to what is published by now. Raises UsageError for a topic of another type."""
        if not self._has_clock and self._subscriber.publishers(CLOCK):
            self._subscriber.subscribe(CLOCK, 1, is_reliable=False)
            self._has_clock = True
        for name, group in tuple(self._missing.items()):
            if found := self._subscriber.publishers(group[0]):
                del self._missing[name]
                self._join(group, found)
        if self._missing and time.monotonic() > self._patience_s:
            self._patience_s = float("inf")
            waiting = ", ".join(sorted(self._missing))
            notice(f"nobody publishes {waiting} in domain {self._options.domain} yet; the relay waits")

    def receive(self, timeout_s: float) -> list[tuple[str, bytes]]:
        """The messages that have come, by the names of their topics."""
        return [(one.topic_name, one.cdr) for one in self._subscriber.receive(timeout_s)]

    def publish(self, topic: Topic, cdr: bytes, now_ns: int) -> bool:
        """Send a message under the prefix; False where a slow subscriber does not take it."""
        return self._publisher.publish(self._options.published_name(topic.name), cdr, now_ns)

    def missed(self, topic: Topic) -> int:
        """How many messages under the prefix slow subscribers missed so far, at least."""
        return self._publisher.missed().messages.get(self._options.published_name(topic.name), 0)

    def close(self) -> None:
        """Withdraw everything, after subscribers have had a moment to take what was sent."""
        self._subscriber.close()
        self._publisher.close()

    def _join(self, group: tuple[Topic, ...], found: Sequence[GraphPublisher]) -> None:
        """The relay asks for the weakest offer, which every publisher makes, and makes the strongest."""
        taken = group[0]
        for one in found:
            if one.type != dds_type_name(taken.type):
                raise UsageError(f"{taken.name} is published as {one_line(one.type)[:100]}, not {taken.type}")
        depth = offered_qos(taken).depth
        self._subscriber.subscribe(
            taken,
            max(depth, 10),
            is_reliable=all(one.is_reliable for one in found),
            is_latched=all(one.is_latched for one in found),
        )
        is_reliable = any(one.is_reliable for one in found)
        is_latched = any(one.is_latched for one in found)
        for topic in group:
            qos = keep_last(offered_qos(topic).depth, reliable=is_reliable, latched=is_latched)
            published = replace(topic, name=self._options.published_name(topic.name), qos=qos)
            self._publisher.advertise(PublishedTopic(published, schema_text(topic.type)))
        notice(f"{taken.name} is relayed to {self._options.published_name(taken.name)}")
