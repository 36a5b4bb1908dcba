"""Any frame of a bag by its number, as independent jobs read them."""

from __future__ import annotations

from pathlib import Path
from threading import Lock

import numpy as np

from advpipe.pipeline.bag.frames import (
    Frame,
    find_lidar_topic,
    latency_ns,
    refuse_without_clouds,
    truth_at,
    vehicle_topics,
)
from advpipe.pipeline.bag.ground_truth import GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import StampedCloud


class FrameReader:
    """Reads the index of a bag once, and for each frame the chunks around it; memory holds one frame.

    topic: of the clouds. times_ns: their log times (F,) int64, ascending. What it reads is what `read_frames`
    yields, in any order, and in threads. Raises UsageError for a bag without such clouds.
    """

    def __init__(self, bag: Path | BagReader, lidar_topic: str | None = None) -> None:
        self._reader = bag if isinstance(bag, BagReader) else BagReader(bag)
        self.topic = find_lidar_topic(self._reader, lidar_topic)
        refuse_without_clouds(self._reader, self.topic)
        self.times_ns = self._reader.log_times_ns(self.topic)
        topics = vehicle_topics(self.topic)
        objects = objects_topic(self._reader, topics)
        self._truth = GroundTruth(self._reader, topics, objects) if objects else None
        self._latency_ns: int | None = None
        self._one_at_a_time = Lock()

    def frame(self, index: int) -> Frame:
        """One frame with its ground truth. Raises AdvpipeError for a damaged bag."""
        with self._one_at_a_time:
            if self._truth is not None:
                self._truth.forget()  # of another frame, which may be a later one
            scan = self._read(index, self._truth)
            found = truth_at(self._truth, scan.stamp_ns, scan.frame_id)
        return Frame(index, scan.stamp_ns, scan.cloud, *found)

    def cloud(self, index: int) -> StampedCloud:
        """The cloud of a frame alone."""
        return self._read(index, None)

    def _read(self, index: int, truth: GroundTruth | None) -> StampedCloud:
        """The cloud, after `truth` took what was logged near it."""
        time_ns, found = int(self.times_ns[index]), []
        near_ns = self._near_ns() if truth else 0
        wanted = [self.topic, *(truth.topic_names if truth else ())]
        for raw in self._reader.raw_messages(wanted, max(0, time_ns - near_ns), time_ns + near_ns):
            if raw.topic.name != self.topic:
                assert truth is not None
                truth.take(raw)
            elif raw.log_time_ns == time_ns:
                found.append(raw)
        place = index - int(np.searchsorted(self.times_ns, time_ns))  # among clouds of one log time
        if place >= len(found):
            raise AdvpipeError(f"{self._reader.path}: damaged (the index of {self.topic} is wrong)")
        return self._reader.cloud(found[place])

    def _near_ns(self) -> int:
        """How far from a cloud its truth may have been logged."""
        if self._latency_ns is None:
            self._latency_ns = latency_ns(self._reader, self.topic, int(self.times_ns[0]))
        return self._latency_ns
