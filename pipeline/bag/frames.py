"""Frames: each cloud of a bag with the road users' boxes at its instant."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.carried import CLOUD_TYPE, lidar_topics, sensors_by_topic
from advpipe.pipeline.bag.ground_truth import BOX_TYPES, LATENCY_NS, GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.uncounted import Uncounted, uncounted_at
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.cloud import Cloud, StampedCloud
from advpipe.pipeline.messages.topics import VehicleTopics

__all__ = [
    "ALL_FRAMES",
    "Frame",
    "FrameSlice",
    "count_frames",
    "find_lidar_topic",
    "has_ground_truth",
    "read_frames",
    "refuse_without_ground_truth",
]


@dataclass(frozen=True)
class Frame:
    """One sweep of the LiDAR and what was around it.

    index: counts the clouds of the bag. boxes: ground truth in the LiDAR's frame, with NaN for unknown
    velocities; empty in a bag without ground truth (`has_ground_truth`). uncounted: what counts neither way.
    """

    index: int
    stamp_ns: int
    cloud: Cloud
    boxes: Boxes
    uncounted: Uncounted = field(default_factory=Uncounted)


def find_lidar_topic(reader: BagReader, lidar_topic: str | None = None) -> str:
    """The named topic of clouds; without a name, the LiDAR's only one, or among several the ego's `lidar`.

    A topic of clouds that the bag's scenario does not know may be named; one of another sensor may not.
    """
    if lidar_topic is not None:
        return _named(reader, lidar_topic)
    candidates = lidar_topics(reader)
    if not candidates:
        others = ", ".join(reader.topics_of_type(CLOUD_TYPE))
        why = f"the point clouds of {others} are not from a LiDAR" if others else f"no {CLOUD_TYPE} topic"
        raise UsageError(f"{reader.path} holds no LiDAR clouds ({why})")
    default = VehicleTopics().lidar_points.name
    if len(candidates) > 1 and default not in candidates:
        raise UsageError(
            f"{reader.path} has several LiDAR topics and none is {default}; "
            f"name one by {option_name('lidar')}: {', '.join(candidates)}"
        )
    return default if default in candidates else candidates[0]


def _named(reader: BagReader, topic: str) -> str:
    clouds, lidars = reader.topics_of_type(CLOUD_TYPE), lidar_topics(reader)
    if not clouds:
        raise UsageError(f"{reader.path} holds no LiDAR clouds (no {CLOUD_TYPE} topic)")
    if topic not in clouds:
        hint = suggestion(topic, lidars or clouds)
        raise UsageError(
            f"{reader.path} has no clouds on {topic}; it has {', '.join(lidars or clouds)}"
            f"{'; ' if hint else ''}{hint}"
        )
    if topic not in lidars and topic in (known := sensors_by_topic(reader) or {}):
        raise UsageError(
            f"{reader.path}: the clouds of {topic} come from sensors.{known[topic].key}, not from a LiDAR; "
            f"it has {', '.join(lidars) or 'none'}"
        )
    return topic


def count_frames(path: Path, lidar_topic: str | None = None) -> int:
    """How many clouds the bag holds."""
    reader = BagReader(path)
    return reader.topics[find_lidar_topic(reader, lidar_topic)].count


def has_ground_truth(path: Path, lidar_topic: str | None = None) -> bool:
    """Whether the bag holds boxes of the road users."""
    reader = BagReader(path)
    return objects_topic(reader, vehicle_topics(find_lidar_topic(reader, lidar_topic))) is not None


def refuse_without_ground_truth(
    path: Path, lidar_topic: str | None = None, *, fix: str = "give the clean bag that holds it"
) -> None:
    """Raises UsageError for a bag without boxes of the road users; fix: what the user can do about it."""
    if not has_ground_truth(path, lidar_topic):
        raise UsageError(f"{path} has no ground truth (no topic of {' or '.join(BOX_TYPES)}); {fix}")


def read_frames(
    bag: Path | BagReader, chosen: FrameSlice = ALL_FRAMES, *, lidar_topic: str | None = None
) -> Iterator[Frame]:
    """The chosen frames in time order, one at a time; clouds in between are not unpacked.

    bag: its path, or the reader of one of which frames are read again and again: it reads the index once.

    The ground truth of a cloud is the message with the same header stamp. Its boxes are brought to the
    LiDAR's frame through /tf_static and the true odometry or /tf.
    """
    return (
        Frame(index, scan.stamp_ns, scan.cloud, *truth_at(truth, scan.stamp_ns, scan.frame_id))
        for index, scan, truth in read_clouds(bag, chosen, lidar_topic=lidar_topic)
    )


def truth_at(truth: GroundTruth | None, stamp_ns: int, lidar_frame: str) -> tuple[Boxes, Uncounted]:
    """The objects at an instant, and what does not count; neither without ground truth."""
    if truth is None:
        return Boxes(), Uncounted()
    return truth.boxes(stamp_ns, lidar_frame), uncounted_at(truth, stamp_ns, lidar_frame)


CloudWithTruth = tuple[int, StampedCloud, "GroundTruth | None"]
"""The number of a cloud in its bag, the cloud, and what gives the truth at its stamp, if the bag has it."""


def read_clouds(
    bag: Path | BagReader, chosen: FrameSlice = ALL_FRAMES, *, lidar_topic: str | None = None
) -> Iterator[CloudWithTruth]:
    """The same with the truth in any frame: ask for it before the next cloud is read."""
    reader = bag if isinstance(bag, BagReader) else BagReader(bag)
    topic = find_lidar_topic(reader, lidar_topic)
    refuse_without_clouds(reader, topic)
    indices = chosen.indices(reader.topics[topic].count)
    return _clouds(reader, topic, indices)


def refuse_without_clouds(reader: BagReader, topic: str) -> None:
    """Raises UsageError for a topic without clouds."""
    if not reader.topics[topic].count:
        raise UsageError(f"{reader.path} holds no LiDAR clouds ({topic} is empty)")


def _clouds(reader: BagReader, topic: str, indices: range) -> Iterator[CloudWithTruth]:
    topics = vehicle_topics(topic)
    objects = objects_topic(reader, topics)
    truth = GroundTruth(reader, topics, objects) if objects else None
    times_ns = reader.log_times_ns(topic)
    near_ns = latency_ns(reader, topic, int(times_ns[indices[0]])) if truth else 0
    runs = [indices] if indices.step == 1 else [range(index, index + 1) for index in indices]
    for run in runs:
        first_ns, last_ns = int(times_ns[run[0]]), int(times_ns[run[-1]])
        index, seen = int(np.searchsorted(times_ns, first_ns)), 0
        for raw in _with_truth(reader, topic, truth, (first_ns, last_ns), near_ns):
            if index in run:
                yield index, reader.cloud(raw), truth
                seen += 1
            index += 1
        if seen != len(run):
            raise AdvpipeError(f"{reader.path}: damaged (the index of {topic} is wrong)")


def latency_ns(reader: BagReader, topic: str, log_time_ns: int) -> int:
    """How far from a cloud its truth may have been logged; in advpipe's own bags, both have one time."""
    first = next(iter(reader.raw_messages([topic], log_time_ns, log_time_ns)), None)
    return 0 if first is None or reader.cloud(first).stamp_ns == log_time_ns else LATENCY_NS


def _with_truth(
    reader: BagReader, topic: str, truth: GroundTruth | None, span_ns: tuple[int, int], near_ns: int
) -> Iterator[RawMessage]:
    """The clouds of a span in one pass over the bag, each after `truth` took all that belongs to it."""
    first_ns, last_ns = span_ns
    wanted = [topic, *(truth.topic_names if truth else ())]
    waiting: deque[RawMessage] = deque()
    for raw in reader.raw_messages(wanted, max(0, first_ns - near_ns), last_ns + near_ns):
        while waiting and raw.log_time_ns > waiting[0].log_time_ns + near_ns:
            yield waiting.popleft()
        if raw.topic.name != topic:
            assert truth is not None
            truth.take(raw)
        elif first_ns <= raw.log_time_ns <= last_ns:
            waiting.append(raw)
    yield from waiting


def vehicle_topics(lidar_topic: str) -> VehicleTopics:
    """The topics of the vehicle that carries the LiDAR: `/ego/lidar/points` belongs to ego."""
    return VehicleTopics(*lidar_topic.strip("/").split("/")[:2])
