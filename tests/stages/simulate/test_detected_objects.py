"""Objects of a vehicle's own detector, followed from cloud to cloud."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.sensors.sensor import Reading
from advpipe.stages.simulate.detected_objects import DetectedObjects
from advpipe.stages.simulate.instrumented import VehicleSnapshot

TOPIC = Topic("/ego/lidar/points", "sensor_msgs/msg/PointCloud2")
CLOUD = Reading(((TOPIC, cloud_to_cdr(np.zeros(1, POINT_DTYPE), 0, ""), 0),))
AT_LIDAR = np.eye(4)
AT_LIDAR[:3, 3] = 0.0, 0.0, 1.7


class Scripted:
    """A detector of one's own: it finds what it is told."""

    classes = ("car",)
    range_m = Range(-50, -50, -5, 50, 50, 5)

    def __init__(self) -> None:
        self.places_m: list[tuple[float, float]] = []

    def detect(self, cloud: np.ndarray) -> Detections:
        boxes = np.array([[x, y, -1.0, 4.5, 1.8, 1.5, 0.0] for x, y in self.places_m]).reshape(-1, 7)
        return Detections(boxes, np.array([0.9] * len(boxes)), np.zeros(len(boxes), np.int64))

    def loss(self, points, boxes, labels):
        raise NotImplementedError


def seen(*steps: list[tuple[float, float]]) -> list[tuple[tuple[str, ...], np.ndarray, np.ndarray]]:
    """Names, places and velocities after each step of 0.1 s."""
    detector = Scripted()
    objects = DetectedObjects(SimpleNamespace(mounts={"lidar": AT_LIDAR}), detector, 0.3)
    pose, found = np.eye(4), []
    pose[:2, 3] = 100.0, 50.0
    for index, places_m in enumerate(steps):
        detector.places_m = places_m
        objects.look(VehicleSnapshot("ego", None, None, (CLOUD,)), pose, index / 10)
        found.append((objects.boxes.ids, objects.boxes.geometry[:, :3], objects.boxes.velocity_mps))
    return found


def test_boxes_are_in_the_frame_of_the_map() -> None:
    ((_, places_m, _),) = seen([(10.0, 2.0)])
    assert places_m.tolist() == [pytest.approx([110.0, 52.0, 0.7])]


def test_an_object_keeps_its_name_and_gets_its_velocity() -> None:
    found = seen(*[[(10.0 + step, 0.0), (0.0, 20.0)] for step in range(12)])
    assert {names for names, _, _ in found} == {("detected 1", "detected 2")}
    assert found[-1][2][:, 0] == pytest.approx([10.0, 0.0], abs=0.1)


def test_what_is_out_of_reach_or_comes_back_late_is_new() -> None:
    names = [names for names, _, _ in seen([(10.0, 0.0)], [(14.0, 0.0)], *[[]] * 10, [(14.0, 0.0)])]
    assert names[0] == ("detected 1",)
    assert names[1] == ("detected 2",)
    assert names[-1] == ("detected 3",)


def test_without_a_cloud_the_last_objects_stay() -> None:
    detector = Scripted()
    detector.places_m = [(5.0, 5.0)]
    objects = DetectedObjects(SimpleNamespace(mounts={"lidar": AT_LIDAR}), detector, 0.3)
    objects.look(VehicleSnapshot("ego", None, None, (CLOUD,)), np.eye(4), 0.0)
    objects.look(VehicleSnapshot("ego", None, None, ()), np.eye(4), 0.1)
    assert objects.boxes.ids == ("detected 1",)
