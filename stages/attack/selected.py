"""The messages of a bag that belong to some of its frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rosbags.interfaces import QosDurability

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import RawMessage


def messages_of_frames(
    reader: BagReader, lidar_topic: str, frames: range
) -> Iterator[tuple[int | None, RawMessage]]:
    """Each message of the frames in log-time order, with its frame if it is a cloud of `lidar_topic`.

    A message belongs to the latest cloud at or before it in log time; what comes before the first cloud
    belongs to that one. Latched topics (/tf_static, /scenario/info) are kept whole: those from before
    the first chosen frame are logged at its time, so that the bag does not begin with a long silence.
    """
    times_ns = reader.log_times_ns(lidar_topic)
    start_ns = int(times_ns[frames[0]]) if frames[0] > 0 else 0
    latched = {name for name, info in reader.topics.items() if _is_latched(info.qos)}
    early: list[RawMessage] = []
    cloud = -1
    for raw in reader.raw_messages():
        if raw.topic.name == lidar_topic:
            cloud += 1
            frame: int | None = cloud
            kept = cloud in frames
        else:
            frame = None
            belongs_to = int(np.searchsorted(times_ns, raw.log_time_ns, side="right")) - 1
            kept = max(belongs_to, 0) in frames
        if raw.topic.name in latched and raw.log_time_ns < start_ns:
            early.append(replace(raw, log_time_ns=start_ns))
        elif kept or raw.topic.name in latched:
            yield from ((None, message) for message in early)
            early.clear()
            yield frame, raw


def _is_latched(profiles: tuple[object, ...]) -> bool:
    return any(getattr(qos, "durability", None) is QosDurability.TRANSIENT_LOCAL for qos in profiles)
