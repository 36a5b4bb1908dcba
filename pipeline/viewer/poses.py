"""Where a sensor or a vehicle stands on the map at an instant."""

from __future__ import annotations

from advpipe.pipeline.bag.carried import CLOUD_TYPE
from advpipe.pipeline.bag.frames import vehicle_topics
from advpipe.pipeline.bag.ground_truth import GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import MAP_FRAME, VehicleTopics


def lidar_SE3_map(reader: BagReader, lidar_topic: str, time_ns: int) -> Float64 | None:
    """The transform from the map at the log time of a cloud; None for a bag without it."""
    topics = vehicle_topics(lidar_topic)
    return frame_SE3_map(reader, topics, lidar_topic, topics.lidar_frame, time_ns)


def frame_SE3_map(
    reader: BagReader, topics: VehicleTopics, timing_topic: str, frame_id: str, time_ns: int
) -> Float64 | None:
    """The transform from the map to a vehicle's frame at the log time of a message; None without it.

    The stamp is that of the message, and the frame that of the cloud if it is one.
    """
    truth = GroundTruth(reader, topics, objects_topic(reader, topics) or "")
    stamp_ns = time_ns
    for raw in reader.raw_messages([*truth.topic_names, timing_topic], time_ns, time_ns):
        if raw.topic.name != timing_topic:
            truth.take(raw)
        elif raw.topic.type == CLOUD_TYPE:
            stamp_ns, frame_id, _ = reader.cloud(raw)
        else:
            stamp_ns = build.stamp_ns(reader.decode(raw))
            truth.take(raw)
    try:
        return truth.lidar_SE3(MAP_FRAME, stamp_ns, frame_id)
    except AdvpipeError:  # no transform connects the two
        return None
