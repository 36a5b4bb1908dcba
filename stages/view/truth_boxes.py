"""What truly stands around a vehicle, as boxes with their stories."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes, count_points
from advpipe.pipeline.geometry.transforms import Float64, yaw_of
from advpipe.pipeline.messages.build import se3_from_pose
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.topics import V2X_STATIONS
from advpipe.pipeline.viewer.scene import IGNORED, TRUTH, Fact, SceneBox, object_title, outcome_lead
from advpipe.stages.view.report_detections import FrameDetections

_LATELY_NS = 200_000_000


def truth_boxes(
    before: Frame, attacked: Cloud | None, detections: FrameDetections | None
) -> Iterator[SceneBox]:
    """The objects of a frame; with detections, what became of each."""
    boxes = before.boxes
    clouds = [before.cloud, *([] if attacked is None else [attacked])]
    points = [count_points(xyz(cloud), boxes.geometry) for cloud in clouds]
    for number, (box, label) in enumerate(zip(boxes.geometry, boxes.labels, strict=True)):
        id = boxes.ids[number]
        outcome = detections.outcomes.get(id, IGNORED) if detections else ""
        scores = detections.scores.get(id) if detections else None
        yield SceneBox(
            TRUTH,
            box.tolist(),
            object_title(CLASSES[label], id),
            outcome,
            id=id,
            group=f"{CLASSES[label]}s",
            lead=outcome_lead(outcome, detections.min_score) if detections else "",
            facts=(
                Fact("range", f"{np.hypot(box[0], box[1]):.1f} m"),
                Fact("LiDAR points", *(str(count[number]) for count in points)),
                *([Fact("score", *scores)] if scores else []),
                *_speed(boxes.velocity_mps[number]),
                _size(box),
            ),
        )


def station_boxes(bag: BagReader, time_ns: int, frame_SE3_map: Float64, vehicle: str) -> Iterator[SceneBox]:
    """The vehicles with a radio, but for the one that looks."""
    if V2X_STATIONS.name not in bag.topics_of_type(V2X_STATIONS.type):
        return
    newest: Any = None
    for raw in bag.raw_messages([V2X_STATIONS.name], max(0, time_ns - _LATELY_NS), time_ns):
        newest = bag.decode(raw)
    for station in newest.stations if newest else ():
        if station.vehicle == vehicle:
            continue
        map_SE3_box, size = se3_from_pose(station.pose), station.size
        row = [*map_SE3_box[:3, 3], size.x, size.y, size.z, yaw_of(map_SE3_box)]
        row[2] += size.z / 2  # the pose is on the ground
        boxes = Boxes(np.array([row]), np.zeros(1, np.int64), ("",), np.zeros((1, 3)))
        box = boxes.transformed(frame_SE3_map).geometry[0]
        velocity = station.velocity
        yield SceneBox(
            TRUTH,
            box.tolist(),
            station.vehicle or f"station {station.station_id}",
            id=f"station {station.station_id}",
            group="stations",
            facts=(
                Fact("station", str(station.station_id)),
                Fact("range", f"{np.hypot(box[0], box[1]):.1f} m"),
                *_speed(np.array([velocity.x, velocity.y, velocity.z])),
                _size(box),
            ),
        )


def _speed(velocity_mps: Float64) -> list[Fact]:
    speed_mps = float(np.linalg.norm(velocity_mps))
    return [Fact("speed", f"{speed_mps:.1f} m/s")] if np.isfinite(speed_mps) else []


def _size(box: Float64) -> Fact:
    return Fact("size", " × ".join(f"{length_m:.1f}" for length_m in box[3:6]) + " m")
