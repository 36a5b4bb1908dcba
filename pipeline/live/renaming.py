"""A publisher that publishes a drive's topics under another stack's names."""

from __future__ import annotations

from dataclasses import replace

from advpipe.pipeline.live.publisher import Missed, PublishedTopic, Publisher
from advpipe.pipeline.messages.topic_names import published_name


class RenamingPublisher:
    """See `Publisher`. names: a key of `PUBLISHED_NAMES`; callers use advpipe's own names throughout."""

    def __init__(self, publisher: Publisher, names: str) -> None:
        self._publisher, self._names = publisher, names
        self._own_names: dict[str, str] = {}

    def advertise(self, published: PublishedTopic) -> None:
        name = published_name(published.topic.name, self._names)
        self._own_names[name] = published.topic.name
        self._publisher.advertise(replace(published, topic=replace(published.topic, name=name)))

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        return self._publisher.publish(published_name(topic_name, self._names), cdr, time_ns)

    def missed(self) -> Missed:
        found = self._publisher.missed()
        return replace(found, messages={self._own_names[name]: n for name, n in found.messages.items()})

    def close(self) -> None:
        self._publisher.close()
