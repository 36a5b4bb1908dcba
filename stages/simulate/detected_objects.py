"""What an instrumented vehicle perceives by a detector on its own clouds, followed from cloud to cloud."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.cloud import cloud_from_cdr
from advpipe.stages.simulate.instrumented import Instrumented, VehicleSnapshot

SAME_M = 3.0
"""A detection within this distance of where a track is expected is the same object."""
KEPT_S = 1.0
NEWEST_SHARE = 0.4
"""Of a track's velocity, by its newest displacement; single displacements are noisy."""
CLOUDS = "sensor_msgs/msg/PointCloud2"


def _is_sensed(topic: Topic) -> bool:
    return topic.type == CLOUDS and "/ground_truth/" not in topic.name


@dataclass
class _Followed:
    """An object: where it was (3,) at `seen_s`, and its velocity (3,)."""

    name: str
    label: int
    at_m: Float64
    velocity_mps: Float64
    seen_s: float


class DetectedObjects:
    """The objects of one vehicle. boxes: those in the newest cloud of its first LiDAR, in the map's frame."""

    def __init__(self, vehicle: Instrumented, detector: ObjectDetector, min_score: float) -> None:
        self._mounts, self._detector, self._min_score = vehicle.mounts, detector, min_score
        self._tracks: list[_Followed] = []
        self._count = 0
        self.boxes = Boxes()

    def look(self, snapshot: VehicleSnapshot, map_SE3_base: Float64, now_s: float) -> None:
        """Detect in the cloud of this step; without one, what was perceived last stays."""
        messages = [message for reading in snapshot.readings for message in reading.messages]
        clouds = sorted((topic.name, cdr) for topic, cdr, _ in messages if _is_sensed(topic))
        if not clouds:
            return
        name, cdr = clouds[0]
        found = self._detector.detect(cloud_from_cdr(cdr).cloud)
        kept = found.scores >= self._min_score
        classes = [CLASSES.index(each) for each in self._detector.classes]
        labels = np.array([classes[label] for label in found.labels[kept].tolist()], np.int64)
        unknown = np.full((len(labels), 3), np.nan)
        seen = Boxes(found.boxes[kept], labels, ("",) * len(labels), unknown)
        map_SE3_lidar = map_SE3_base @ self._mounts[name.split("/")[2]]
        self.boxes = self._followed(seen.transformed(map_SE3_lidar), now_s)

    def _followed(self, boxes: Boxes, now_s: float) -> Boxes:
        """The boxes with names and velocities; each track takes the nearest box of its class."""
        self._tracks = [track for track in self._tracks if now_s - track.seen_s <= KEPT_S]
        free = list(range(len(boxes)))
        tracks: list[_Followed | None] = [None] * len(boxes)
        for track in self._tracks:
            expected_m = track.at_m + track.velocity_mps * (now_s - track.seen_s)
            near = [
                (float(np.linalg.norm(boxes.geometry[index, :2] - expected_m[:2])), index)
                for index in free
                if boxes.labels[index] == track.label
            ]
            if near and min(near)[0] <= SAME_M:
                index = min(near)[1]
                free.remove(index)
                tracks[index] = track
                moved_mps = (boxes.geometry[index, :3] - track.at_m) / max(now_s - track.seen_s, 1e-3)
                track.velocity_mps = NEWEST_SHARE * moved_mps + (1 - NEWEST_SHARE) * track.velocity_mps
                track.at_m, track.seen_s = boxes.geometry[index, :3].copy(), now_s
        for index in free:
            self._count += 1
            at_m = boxes.geometry[index, :3].copy()
            new = _Followed(f"detected {self._count}", int(boxes.labels[index]), at_m, np.zeros(3), now_s)
            self._tracks.append(new)
            tracks[index] = new
        named = [track for track in tracks if track is not None]
        velocities: Float64 = np.array([track.velocity_mps for track in named]).reshape(-1, 3)
        return Boxes(boxes.geometry, boxes.labels, tuple(track.name for track in named), velocities)
