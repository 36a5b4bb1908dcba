"""Which clouds of the fusing vehicle are fused: while any poses are false, of the frames asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.stages.evaluate.cooperative.pair import Pair

MOST_FRAMES = 50


def false_span(reader: BagReader, pair: Pair, changed_ns: Sequence[int]) -> range:
    """The fusing vehicle's clouds from the first to the last time at which poses or CPMs are false."""
    times_ns = reader.log_times_ns(pair.own.lidar_points.name)
    if not changed_ns:
        return range(0)
    return range(
        int(np.searchsorted(times_ns, min(changed_ns))),
        int(np.searchsorted(times_ns, max(changed_ns), "right")),
    )


def asked_for(
    reader: BagReader, pair: Pair, frames: FrameSlice = ALL_FRAMES, lidar_topic: str | None = None
) -> range:
    """The fusing vehicle's clouds that `frames` choose; these count the clouds of `lidar_topic`.

    Where that is another LiDAR, those in the time that the chosen clouds span, with the same step. Raises
    AdvpipeError for a choice of none.
    """
    own = pair.own.lidar_points.name
    own_ns = reader.log_times_ns(own)
    if frames == ALL_FRAMES:
        return range(len(own_ns))
    topic = find_lidar_topic(reader, lidar_topic)
    times_ns = reader.log_times_ns(topic)
    chosen = frames.indices(len(times_ns))
    if topic == own:
        return chosen
    first = int(np.searchsorted(own_ns, times_ns[chosen[0]]))
    stop = int(np.searchsorted(own_ns, times_ns[chosen[-1]], "right"))
    return range(first, stop, chosen.step)


def fused_instants(asked: range, false: range) -> FrameSlice | None:
    """At most `MOST_FRAMES` of those that are in both, equally spaced; None where there are none.

    false: with a step of 1.
    """
    both = [index for index in asked if index in false]
    if not both:
        return None
    return FrameSlice(both[0], both[-1] + 1, asked.step * -(-len(both) // MOST_FRAMES))
