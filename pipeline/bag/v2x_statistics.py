"""The statistics of a drive's V2X in a bag: a latched message of JSON, which other tools keep."""

from __future__ import annotations

from advpipe.pipeline.bag import messages
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import V2X_STATISTICS
from advpipe.pipeline.bag.types import serialise
from advpipe.pipeline.bag.v2x import StampedCdr
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.v2x.statistics import Statistics


def statistics_message(stamp_ns: int, statistics: Statistics) -> StampedCdr:
    """std_msgs/String."""
    message = messages.string(statistics.to_json())
    return V2X_STATISTICS, serialise(message, V2X_STATISTICS.type), stamp_ns


def read_statistics(reader: BagReader) -> Statistics | None:
    """Those that are recorded last; None for a bag without.

    Raises AdvpipeError where they cannot be read.
    """
    if V2X_STATISTICS.name not in reader.topics:
        return None
    texts = [str(message.data) for _, message in reader.messages(V2X_STATISTICS.name)]
    try:
        return Statistics.from_json(texts[-1]) if texts else None
    except ValueError:
        raise AdvpipeError(
            f"{reader.path}: {V2X_STATISTICS.name} holds no statistics of this version; record it again"
        ) from None
