"""Which of several LiDARs is used, said in one line where the user named none."""

from __future__ import annotations

from functools import cache

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.verbosity import notice

_notice_once = cache(notice)
"""A sweep attacks and evaluates one bag many times."""


def notice_default_lidar(reader: BagReader, lidar_topic: str | None = None) -> None:
    """Prints the topic of the clouds that are taken by default, if there are others and none is named."""
    topics = lidar_topics(reader)
    if lidar_topic is not None or len(topics) < 2:
        return
    default = find_lidar_topic(reader)
    others = " or ".join(topic for topic in topics if topic != default)
    _notice_once(
        f"note: {reader.path} has {len(topics)} LiDARs; {default} is used by default, "
        f"{option_name('lidar')} chooses another: {others}"
    )
