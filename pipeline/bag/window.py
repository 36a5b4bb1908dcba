"""The time of a recording that chosen clouds span: what the option `frames` bounds besides clouds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.option_names import option_name

ONE_CLOUD_NS = 100_000_000
"""The period where a bag holds a single cloud: that of a LiDAR that turns at 10 Hz."""


@dataclass(frozen=True)
class Window:
    """Log times from begin_ns on and before end_ns, in nanoseconds; without an end_ns to the last message."""

    begin_ns: int = 0
    end_ns: int | None = None

    @property
    def last_ns(self) -> int | None:
        """The last log time inside, as `BagReader.raw_messages` takes it."""
        return None if self.end_ns is None else self.end_ns - 1

    def holds(self, times_ns: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which of these times (N,) are inside."""
        times = np.asarray(times_ns, np.int64)
        inside: npt.NDArray[np.bool_] = (times >= self.begin_ns) & self.is_before_end(times)
        return inside

    def is_before_end(self, times_ns: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Which of these times (N,) are inside or earlier."""
        times = np.asarray(times_ns, np.int64)
        return np.ones(times.shape, bool) if self.end_ns is None else times < self.end_ns


WHOLE_DRIVE = Window()


def window_of(reader: BagReader, frames: FrameSlice, lidar_topic: str | None = None) -> Window:
    """From the first chosen cloud to one period, the median of the LiDAR's, after the last one.

    A step leaves out clouds, not time. All frames are the whole drive, with clouds or without. Raises
    UsageError for a choice of none and for a bag without clouds.
    """
    if frames == ALL_FRAMES:
        return WHOLE_DRIVE
    if not lidar_topics(reader):
        raise UsageError(
            f"{reader.path} holds no LiDAR clouds, so the frames {frames} select no time span; leave "
            f"{option_name('frames')} out"
        )
    times_ns = reader.log_times_ns(find_lidar_topic(reader, lidar_topic))
    chosen = frames.indices(len(times_ns))
    period_ns = int(np.median(np.diff(times_ns))) if len(times_ns) > 1 else ONE_CLOUD_NS
    return Window(int(times_ns[chosen[0]]), int(times_ns[chosen[-1]]) + period_ns)
