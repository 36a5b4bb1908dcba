"""One bag as the viewer reads it: at which instants, from where, and what is there at each of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.carried import CLOUD_TYPE
from advpipe.pipeline.bag.frames import Frame, FrameSlice, find_lidar_topic, read_frames, vehicle_topics
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.view.paths import ODOMETRY, Paths

PERIOD_NS = 100_000_000
"""Between two frames of a bag without clouds, at least."""


@dataclass(frozen=True)
class Viewpoint:
    """What the frames of a bag are: clouds of a LiDAR's topic, or instants of a vehicle without one.

    timing_topic: the one whose messages the frames are. frame_id: the frame of the scene.
    """

    topics: VehicleTopics
    timing_topic: str
    frame_id: str
    has_clouds: bool


def find_viewpoint(reader: BagReader, lidar_topic: str | None = None) -> Viewpoint:
    """The clouds of a LiDAR; without LiDAR, the poses of the ego, or of the first vehicle.

    Raises UsageError for a bag with neither, and for a LiDAR's topic that it lacks.
    """
    if lidar_topic is not None or reader.topics_of_type(CLOUD_TYPE):
        topic = find_lidar_topic(reader, lidar_topic)
        if not reader.topics[topic].count:
            raise UsageError(f"{reader.path} holds no LiDAR clouds ({topic} is empty)")
        topics = vehicle_topics(topic)
        return Viewpoint(topics, topic, topics.lidar_frame, has_clouds=True)
    names = {name.strip("/").split("/")[0] for name in reader.topics_of_type(ODOMETRY)}
    for vehicle in sorted(names, key=lambda name: (name != VehicleTopics().vehicle, name)):
        topics = VehicleTopics(vehicle)
        known = reader.topics.get(topics.true_odometry.name)
        if known is not None and known.type == ODOMETRY and known.count:
            return Viewpoint(topics, topics.true_odometry.name, topics.base_frame, has_clouds=False)
    raise UsageError(f"{reader.path} holds neither LiDAR clouds nor the true poses of a vehicle")


class Recording:
    """One bag, by the log times of its frames. debug: a reader of its debug topics, too."""

    def __init__(self, path: Path, viewpoint: Viewpoint) -> None:
        self.path, self.viewpoint = path, viewpoint
        self.reader, self.debug = BagReader(path), BagReader(path, debug=True)
        self.paths = Paths(self.reader)
        topic = viewpoint.timing_topic
        times_ns = self.reader.log_times_ns(topic) if topic in self.reader.topics else np.zeros(0, np.int64)
        self.times_ns = times_ns if viewpoint.has_clouds else _apart(times_ns)

    @property
    def changes_messages(self) -> bool:
        """Whether attacks changed more than clouds; else what other topics hold is the clean bag's."""
        attacks = self.reader.provenance.fields.attacks
        return not attacks or any(attack.family != "lidar" for attack in attacks)

    def has(self, time_ns: int) -> bool:
        """Whether it has a frame of this log time."""
        return bool((self.times_ns == time_ns).any())

    def frame(self, time_ns: int) -> Frame | None:
        """The cloud of this log time, with its boxes; None where there is none."""
        (found,) = np.nonzero(self.times_ns == time_ns)
        if not len(found) or not self.viewpoint.has_clouds:
            return None
        chosen, topic = FrameSlice(int(found[0]), int(found[0]) + 1), self.viewpoint.timing_topic
        return next(iter(read_frames(self.path, chosen, lidar_topic=topic)))


def _apart(times_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Those that are at least `PERIOD_NS` apart, in bins of it."""
    if not len(times_ns):
        return times_ns
    bins = (times_ns - times_ns[0] + PERIOD_NS // 2) // PERIOD_NS
    return times_ns[np.unique(bins, return_index=True)[1]]
