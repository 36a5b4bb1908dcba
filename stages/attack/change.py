"""The changes that attacks on messages make to a bag: some topics are replaced, the others stay."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.stages.attack.debug import DebugMessages


class Change(Protocol):
    """The new messages of some topics of a bag, with labels and counts."""

    @property
    def topics(self) -> frozenset[str]:
        """The topics whose messages are all replaced."""

    def messages(self) -> Iterator[RawMessage]:
        """All messages of these topics, in log-time order."""

    def write_labels(self, folder: Path) -> None:
        """Write Parquet files with the labels of the changes beside the bag."""

    def counts(self) -> Counter[str]:
        """The number of changes by their names in the summary; call it after `write_labels`."""


def changed_messages(
    reader: BagReader, changes: Sequence[Change], debug: DebugMessages | None = None
) -> Iterator[RawMessage]:
    """All messages of a bag in log-time order; messages of the changes replace those of their topics.

    Other messages stay byte for byte. Messages with the same log time keep the order of their topics in the
    bag. No topic may belong to two changes. debug: what the changes add to it comes among the messages.
    """
    replaced = frozenset[str]().union(*(change.topics for change in changes))
    place = {name: index for index, name in enumerate(reader.topics)}
    untouched = [name for name in reader.topics if name not in replaced]
    streams = [change.messages() for change in changes]
    if untouched:
        streams.append(reader.raw_messages(untouched))
    merged = heapq.merge(*streams, key=lambda raw: (raw.log_time_ns, place.get(raw.topic.name, len(place))))
    return merged if debug is None else debug.merged(merged)
