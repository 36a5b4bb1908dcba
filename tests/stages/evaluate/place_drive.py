"""A small drive written by hand, and detectors whose result on it a person can work out."""

import json
from dataclasses import replace

import numpy as np

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes, count_points
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr, xyz
from advpipe.pipeline.messages.topics import VehicleTopics

FRAMES = 18  # 12.6 s: two blocks; of cars, the 50 boxes that make a class count
PERIOD_NS = 700_000_000
PLACES = np.array(
    [
        [10.0, 3.0, 0.0, 4.0, 2.0, 1.5, 0.2],  # three cars ...
        [18.0, -4.0, 0.0, 4.2, 1.9, 1.5, 0.0],
        [6.0, -6.0, 0.0, 4.4, 1.8, 1.6, 1.5],
        [12.0, 9.0, 0.0, 0.8, 0.8, 1.8, 0.0],  # ... a pedestrian ...
        [90.0, 0.0, 0.0, 4.0, 2.0, 1.5, 0.0],  # ... a car out of range ...
        [25.0, 15.0, 0.0, 4.0, 2.0, 1.5, 0.0],  # ... and one that the LiDAR does not hit
    ]
)
LABELS = np.array([0, 0, 0, 3, 0, 0])
POINTS = (60, 50, 40, 30, 50, 0)
TOPICS = VehicleTopics("ego")


class PlaceDetector:
    """Sees a car or a person at each of the places that holds at least 20 points."""

    least = 20
    classes = ("pedestrian", "car")  # its own order, not ours
    range_m = Range(0, -40, -3, 70, 40, 3)

    def detect(self, cloud):
        points = count_points(xyz(cloud), PLACES)
        seen = np.flatnonzero(points >= self.least)
        seen = seen[np.argsort(-points[seen], kind="stable")]
        labels = np.array([self.classes.index(CLASSES[label]) for label in LABELS[seen]], np.int64)
        return Detections(PLACES[seen], points[seen] / 100, labels)

    def loss(self, points, boxes, labels):
        raise AssertionError("nobody asks for this here")


class BlindDetector(PlaceDetector):
    def detect(self, cloud):
        return Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))


class KeenDetector(PlaceDetector):
    """Sees what holds 12 points."""

    least = 12


class MirroredDetector(PlaceDetector):
    """Sees the places where their mirror images are, and nothing else."""

    def detect(self, cloud):
        mirrored = cloud.copy()
        mirrored["y"] *= -1
        found = super().detect(mirrored)
        return replace(found, boxes=found.boxes * [1, -1, 1, 1, 1, 1, -1])


class FaintDetector(PlaceDetector):
    """Sees the first car, faintly, and forty cars for certain where there are none."""

    def detect(self, cloud):
        false = np.tile(PLACES[0], (40, 1))
        false[:, 0], false[:, 1] = 40.0, np.linspace(-39, 39, 40)
        seen = PLACES[:1][count_points(xyz(cloud), PLACES[:1]) >= self.least]
        scores = np.append(np.full(40, 0.9), np.full(len(seen), 0.1))
        labels = np.full(len(scores), self.classes.index("car"), np.int64)
        return Detections(np.concatenate([false, seen]), scores, labels)


DETECTOR = "place_drive:PlaceDetector"


def clean_cloud(index):
    """3,000 points on the ground and some in each place, those of place 0 first."""
    rng = np.random.default_rng(index)
    inside = [
        box[:3] + rng.uniform(-0.45, 0.45, (n, 3)) * box[3:6].min()
        for box, n in zip(PLACES, POINTS, strict=True)
    ]
    ground = np.column_stack(
        [rng.uniform(-30, 60, (3000, 1)), rng.uniform(-30, 30, (3000, 1)), -1.5 * np.ones(3000)]
    )
    points = np.concatenate([*inside, ground])
    cloud = np.zeros(len(points), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = points.T
    cloud["time"] = np.arange(len(points)) * 1e-6
    return cloud


def write_bag(path, provenance, clouds, truth=True):
    """clouds: by index of the frame."""
    with BagWriter(path, provenance=provenance) as bag:
        for index, cloud in clouds.items():
            stamp_ns = 10**12 + index * PERIOD_NS
            bag.write_cdr(TOPICS.lidar_points, cloud_to_cdr(cloud, stamp_ns, TOPICS.lidar_frame), stamp_ns)
            if truth:
                ids = tuple(f"user{i}" for i in range(len(PLACES)))
                boxes = Boxes(PLACES, LABELS, ids, np.zeros((len(PLACES), 3)))
                bag.write(
                    TOPICS.objects, build.detections_message(stamp_ns, TOPICS.lidar_frame, boxes), stamp_ns
                )
    return path


def hide_first_car(cloud):
    """Leaves 15 of the 60 points of place 0."""
    return cloud[45:]


def rows(out):
    return json.loads((out / "report.json").read_text())["rows"]
