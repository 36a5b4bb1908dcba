"""A publisher that publishes a drive's topics under another stack's names, and as its messages."""

from __future__ import annotations

from dataclasses import replace

from advpipe.pipeline.live.publisher import Missed, PublishedTopic, Publisher
from advpipe.pipeline.messages.bridge_messages import bridge_message, bridge_type
from advpipe.pipeline.messages.topic_names import published_name
from advpipe.pipeline.messages.types import schema_text


class RenamingPublisher:
    """See `Publisher`. names: a key of `PUBLISHED_NAMES`; callers use advpipe's own names throughout."""

    def __init__(self, publisher: Publisher, names: str) -> None:
        self._publisher, self._names = publisher, names
        self._own_names: dict[str, str] = {}
        self._converted: dict[str, str] = {}

    def advertise(self, published: PublishedTopic) -> None:
        ours = published.topic
        topic = replace(ours, name=published_name(ours.name, self._names))
        self._own_names[topic.name] = ours.name
        if topic.name != ours.name:
            self._converted[ours.name] = ours.type
            topic = replace(topic, type=bridge_type(ours.type))
        if topic.type != ours.type:
            published = PublishedTopic(topic, schema_text(topic.type))
        self._publisher.advertise(replace(published, topic=topic))

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        if topic_name in self._converted:
            cdr = bridge_message(self._converted[topic_name], cdr)
        return self._publisher.publish(published_name(topic_name, self._names), cdr, time_ns)

    def missed(self) -> Missed:
        found = self._publisher.missed()
        return replace(found, messages={self._own_names[name]: n for name, n in found.messages.items()})

    def close(self) -> None:
        self._publisher.close()
