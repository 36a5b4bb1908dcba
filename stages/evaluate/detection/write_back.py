"""Bags that show what the detector saw: the messages of a bag and the detections beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.mcap.channel import RawMessage, Topic
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.types import schema_text, serialise, type_hash
from advpipe.stages.evaluate.detection.occlusion import vehicle_of

DETECTIONS_TYPE = "vision_msgs/msg/Detection3DArray"


def write_detections(
    source: Path,
    out: Path,
    found: Mapping[int, Detections],
    detector: Mapping[str, object],
    *,
    lidar_topic: str | None = None,
    with_clouds: bool = False,
) -> None:
    """Write a bag of the source's messages, the clouds of its LiDARs left out, and of detections.

    found: by the index of the cloud; labels index `geometry.boxes.CLASSES`. They stand on
    `/<vehicle>/detections` in the LiDAR's frame, with the cloud's stamp and log time. detector: what the
    provenance says of it.
    """
    reader = BagReader(source)
    clouds = find_lidar_topic(reader, lidar_topic)
    topic = detections_topic(clouds)
    about = {
        "kind": "detections",
        "parent_sha256": parent_sha256(source),
        "lidar_topic": clouds,
        "detector": json.dumps(detector, sort_keys=True),
    }
    left_out = {topic.name} if with_clouds else {topic.name, *lidar_topics(reader)}
    index = 0
    with BagWriter(out, provenance={**_inherited(reader), **about}) as bag:
        for raw in reader.raw_messages():
            if raw.topic.name not in left_out:  # the source's own detections make place
                bag.copy(raw)
            if raw.topic.name == clouds:
                if index in found:
                    bag.copy(_message(reader, raw, topic, found[index], index))
                index += 1


def detections_topic(lidar_topic: str) -> Topic:
    """Where the detections in a LiDAR's clouds are written: `/ego/detections` for ego's."""
    name = f"/{vehicle_of(lidar_topic).vehicle}/detections"
    return Topic(name, DETECTIONS_TYPE, type_hash=type_hash(DETECTIONS_TYPE))


def _message(reader: BagReader, raw: RawMessage, topic: Topic, found: Detections, index: int) -> RawMessage:
    stamp_ns, frame_id, _ = reader.cloud(raw)
    cdr = serialise(predictions_message(stamp_ns, frame_id, found), topic.type)
    return RawMessage(topic, schema_text(topic.type), cdr, raw.log_time_ns, raw.publish_time_ns, index)


def predictions_message(stamp_ns: int, frame_id: str, found: Detections) -> Any:
    """vision_msgs/Detection3DArray, best first, with scores; detections have no name over time."""
    boxes = Boxes(found.boxes, found.labels, ("",) * len(found), np.zeros((len(found), 3)))
    message = build.detections_message(stamp_ns, frame_id, boxes)
    for item, score in zip(message.detections, found.scores, strict=True):
        item.results[0].hypothesis.score = float(score)
    return message


def _inherited(reader: BagReader) -> dict[str, str]:
    return {key: reader.provenance[key] for key in ("scenario_name", "scenario") if key in reader.provenance}
