"""What publishes the messages of a bag to running programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.mcap.channel import Topic


@dataclass(frozen=True)
class PublishedTopic:
    """A topic to publish, with the definition of its type: `ros2msg` or `ros2idl`, as a bag holds it."""

    topic: Topic
    schema: str
    schema_encoding: str = "ros2msg"


class UnpublishableTypeError(UsageError):
    """A publisher cannot announce topics of a type; the message names topic, type and reason."""


class Publisher(Protocol):
    """Publishes serialised messages; it is used by one thread."""

    def advertise(self, published: PublishedTopic) -> None:
        """Announce a topic, before its first message. Raises UnpublishableTypeError."""

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        """Send a message of an announced topic: its body in CDR, as in a bag, and its time in the bag.

        Returns whether it was sent; False where a subscriber is too slow to take it. Memory stays bounded.
        Raises AdvpipeError for bytes that are not a message of the topic's type.
        """

    def close(self) -> None:
        """Wait a moment until subscribers have what was sent, and withdraw all topics."""
