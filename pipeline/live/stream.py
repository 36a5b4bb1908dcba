"""Publishes a drive while it is recorded, at most in real time."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.live.playback_clock import PlaybackClock
from advpipe.pipeline.live.publisher import (
    PublishedTopic,
    Publisher,
    UnpublishableTypeError,
    missed_in_words,
)
from advpipe.pipeline.live.registry import open_publisher
from advpipe.pipeline.live.renaming import RenamingPublisher
from advpipe.pipeline.mcap.channel import StampedCdr
from advpipe.pipeline.messages.topic_names import ADVPIPE
from advpipe.pipeline.messages.types import schema_text

FIND_S = 1.0
"""How long subscribers have to find new topics before their first message."""


class LiveStream:
    """Waits until the messages of a step are due, then publishes them; topics are announced as they come, and
    the drive stands still while subscribers find them.

    A step that is late is published at once, and the next one is due a step later: nothing is caught up.
    behind_s: by how much real time was missed, of all steps together.
    """

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._announced: dict[str, bool] = {}
        self._clock: PlaybackClock | None = None
        self.messages, self.refused, self.behind_s = 0, 0, 0.0

    def publish(self, messages: Sequence[StampedCdr]) -> None:
        """Publish the messages of one step, in the order of their stamps, when the last one is due."""
        if not messages:
            return
        due_ns = max(stamp_ns for _, _, stamp_ns in messages)
        self._wait(due_ns)
        fresh = {topic.name: topic for topic, _, _ in messages if topic.name not in self._announced}
        for topic in fresh.values():
            self._announced[topic.name] = self._announce(PublishedTopic(topic, schema_text(topic.type)))
        if fresh:
            time.sleep(FIND_S)
        self._clock = PlaybackClock(due_ns)
        for topic, cdr, stamp_ns in messages:
            if self._announced[topic.name]:
                was_taken = self._publisher.publish(topic.name, cdr, stamp_ns)
                self.messages += was_taken
                self.refused += not was_taken

    def _wait(self, stamp_ns: int) -> None:
        left_s = self._clock.left_s(stamp_ns) if self._clock else 0.0
        if left_s > 0:
            time.sleep(left_s)
        else:
            self.behind_s -= left_s

    def _announce(self, published: PublishedTopic) -> bool:
        try:
            self._publisher.advertise(published)
        except UnpublishableTypeError as error:
            notice(f"{error}; it is left out")
            return False
        return True


@contextmanager
def live_stream(name: str | None, names: str = ADVPIPE) -> Iterator[LiveStream | None]:
    """A stream to the publisher of this name, which says where it publishes and, at the end, what; None for
    none. names: of the topics, a key of `PUBLISHED_NAMES`."""
    if name is None:
        yield None
        return
    place, publisher = open_publisher(name)
    with closing(publisher):
        notice(f"the drive is published to {place} while it is recorded")
        stream = LiveStream(RenamingPublisher(publisher, names))
        yield stream
    missed = publisher.missed()
    in_words = missed_in_words(stream.refused + sum(missed.messages.values()), missed.uncounted)
    notice(
        f"published {counted(stream.messages, 'message')} to {place}, {stream.behind_s:.1f} s behind real "
        f"time; {in_words}"
    )
