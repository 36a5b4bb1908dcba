"""One line on several LiDARs where the user named none: which one is used, or that one has to be named."""

from __future__ import annotations

from functools import cache

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.messages.topics import VehicleTopics

_notice_once = cache(notice)
"""A sweep attacks and evaluates one bag many times."""


def notice_default_lidar(reader: BagReader, lidar_topic: str | None = None) -> None:
    """Prints which of a bag's several LiDARs is used by default, or that none is, if none is named."""
    topics = lidar_topics(reader)
    if lidar_topic is not None or len(topics) < 2:
        return
    option, default = option_name("lidar"), VehicleTopics().lidar_points.name
    if default not in topics:
        _notice_once(
            f"note: {reader.path} has {len(topics)} LiDARs; name one by {option}: {' or '.join(topics)}"
        )
        return
    others = " or ".join(topic for topic in topics if topic != default)
    _notice_once(
        f"note: {reader.path} has {len(topics)} LiDARs; {default} is used by default, "
        f"{option} chooses another: {others}"
    )
