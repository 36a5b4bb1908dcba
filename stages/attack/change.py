"""What attacks on messages do to a bag: some topics are replaced, and the rest stays as it is."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage


class Change(Protocol):
    """The new messages of some topics of a bag, and what is to be known about them."""

    @property
    def topics(self) -> frozenset[str]:
        """Those that are replaced wholly."""

    def messages(self) -> Iterator[RawMessage]:
        """All messages of these topics, in log-time order."""

    def write_labels(self, folder: Path) -> None:
        """Parquet files that say what was changed, beside the bag."""

    def counts(self) -> Counter[str]:
        """How much of what was changed, in the words of the summary; after `write_labels`."""


def changed_messages(reader: BagReader, changes: Sequence[Change]) -> Iterator[RawMessage]:
    """All messages of a bag in log-time order, those of the changes instead of its own.

    Messages that nobody changes come as they lie in the bag. Of one instant, messages keep the order of
    their topics in the bag. No topic may belong to two changes.
    """
    replaced = frozenset[str]().union(*(change.topics for change in changes))
    place = {name: index for index, name in enumerate(reader.topics)}
    untouched = [name for name in reader.topics if name not in replaced]
    streams = [change.messages() for change in changes]
    if untouched:
        streams.append(reader.raw_messages(untouched))
    return heapq.merge(*streams, key=lambda raw: (raw.log_time_ns, place.get(raw.topic.name, len(place))))
