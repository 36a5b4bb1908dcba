"""The roads of a drive, as its bag holds them."""

from __future__ import annotations

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.markers import lanes_of_markers
from advpipe.pipeline.messages.topics import LANES
from advpipe.pipeline.misbehaviour.roads import RoadMap, lanes


def roads_of_bag(reader: BagReader) -> RoadMap | None:
    """The roads of a drive; None for a bag without them."""
    if LANES.name not in reader.topics:
        return None
    return next((lanes(lanes_of_markers(message)) for _, message in reader.messages(LANES.name)), None)
