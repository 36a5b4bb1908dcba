"""Validation against a detector whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.stages.train.validate import validate


class Oracle:
    """Knows the truth of each cloud; sees classes in another order, and half of the cars."""

    classes = ("pedestrian", "car")
    range_m = Range(-8, -8, -3, 8, 8, 1)

    def __init__(self, frames):
        self.truths = {frame.cloud.tobytes(): frame for frame in frames}

    def detect(self, cloud):
        frame = self.truths[cloud.tobytes()]
        wanted = [3, 0] if frame.index % 2 else [3]
        rows = [int(np.flatnonzero(frame.boxes.labels == label)[0]) for label in wanted]
        labels = np.array([{3: 0, 0: 1}[label] for label in wanted])
        return Detections(frame.boxes.geometry[rows], np.linspace(0.9, 0.8, len(rows)), labels)

    def loss(self, points, boxes, labels):
        raise NotImplementedError


def test_average_precision_of_known_detections(drive):
    frames = list(read_frames(drive))
    precision = validate(Oracle(frames), frames, min_points=5)
    assert set(precision) == {"car", "pedestrian"}
    assert precision["pedestrian"].boxes == precision["car"].boxes == 6
    assert precision["pedestrian"].strict_percent == pytest.approx(100)
    assert precision["car"].strict_percent == pytest.approx(50)
    assert precision["car"].loose_percent == pytest.approx(50)


def test_boxes_with_too_few_points_do_not_count(drive):
    frames = list(read_frames(drive))
    precision = validate(Oracle(frames), frames, min_points=10_000)
    assert precision["car"].boxes == 0
    assert np.isnan(precision["car"].strict_percent)
