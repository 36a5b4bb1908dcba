"""The statistics of a drive's V2X in a bag: a latched message of JSON, which other tools keep."""

from __future__ import annotations

from advpipe.pipeline.bag.latched import read_latched
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import StampedCdr
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import V2X_STATISTICS
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.v2x.statistics import Statistics


def statistics_message(stamp_ns: int, statistics: Statistics) -> StampedCdr:
    """std_msgs/String."""
    message = build.string(statistics.to_json())
    return V2X_STATISTICS, serialise(message, V2X_STATISTICS.type), stamp_ns


def read_statistics(reader: BagReader) -> Statistics | None:
    """Those that are recorded last; None for a bag without.

    Raises AdvpipeError where they cannot be read.
    """
    if V2X_STATISTICS.name not in reader.topics:
        return None
    if not reader.topics[V2X_STATISTICS.name].count:
        return None
    where = f"{reader.path}: {V2X_STATISTICS.name} does not hold V2X statistics of this version"
    statistics: Statistics = read_latched(reader, V2X_STATISTICS.name, Statistics, where)
    return statistics
