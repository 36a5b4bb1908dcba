"""Where the LiDAR stands on the map at an instant."""

from __future__ import annotations

from advpipe.pipeline.bag.frames import vehicle_topics
from advpipe.pipeline.bag.ground_truth import GroundTruth, objects_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.topics import MAP_FRAME


def lidar_SE3_map(reader: BagReader, lidar_topic: str, time_ns: int) -> Float64 | None:
    """The transform from the map at the log time of a cloud; None for a bag without it."""
    topics = vehicle_topics(lidar_topic)
    truth = GroundTruth(reader, topics, objects_topic(reader, topics) or "")
    stamp_ns, frame_id = time_ns, topics.lidar_frame
    for raw in reader.raw_messages([*truth.topic_names, lidar_topic], time_ns, time_ns):
        if raw.topic.name == lidar_topic:
            stamp_ns, frame_id, _ = reader.cloud(raw)
        else:
            truth.take(raw)
    try:
        return truth.lidar_SE3(MAP_FRAME, stamp_ns, frame_id)
    except AdvpipeError:  # no transform connects the two
        return None
