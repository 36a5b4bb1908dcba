"""What publishes the messages of a bag to running programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.mcap.channel import Topic


@dataclass(frozen=True)
class PublishedTopic:
    """A topic to publish, with the definition of its type: `ros2msg` or `ros2idl`, as a bag holds it."""

    topic: Topic
    schema: str
    schema_encoding: str = "ros2msg"


class UnpublishableTypeError(UsageError):
    """A publisher cannot announce topics of a type; the message names topic, type and reason."""


@dataclass(frozen=True)
class Missed:
    """What slow subscribers missed, as far as a publisher can know.

    messages: by topic, how many at least. uncounted: whether there are others, which it cannot count.
    """

    messages: Mapping[str, int] = field(default_factory=dict)
    uncounted: bool = False


def missed_in_words(count: int, uncounted: bool = False) -> str:
    """A part of a sentence.

    >>> missed_in_words(0)
    'reliable subscribers acknowledged everything'
    """
    parts = [f"slow subscribers missed at least {counted(count, 'message')}"] if count else []
    parts += ["a slow viewer missed some"] if uncounted else []
    return " and ".join(parts) or "reliable subscribers acknowledged everything"


class Publisher(Protocol):
    """Publishes serialised messages; it is used by one thread."""

    def advertise(self, published: PublishedTopic) -> None:
        """Announce a topic, before its first message. Raises UnpublishableTypeError."""

    def publish(self, topic_name: str, cdr: bytes, time_ns: int) -> bool:
        """Send a message of an announced topic: its body in CDR, as in a bag, and its time in the bag.

        Returns whether it was sent; False where a subscriber is too slow to take it. Memory stays bounded.
        Raises AdvpipeError for bytes that are not a message of the topic's type.
        """

    def missed(self) -> Missed:
        """What slow subscribers missed so far; complete after `close`."""

    def close(self) -> None:
        """Wait a moment until subscribers have what was sent, and withdraw all topics."""
