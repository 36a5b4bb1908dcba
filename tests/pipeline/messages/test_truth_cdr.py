"""The ground truth's messages, written field by field, against rosbags' serialisation of the same values."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.markers import markers
from advpipe.pipeline.messages.truth_cdr import detections_cdr, markers_cdr, road_users_cdr
from advpipe.pipeline.messages.types import serialise

STAMP_NS = 1_767_268_800_123_456_789


def _boxes(count: int) -> Boxes:
    rng = np.random.default_rng(count)
    geometry = rng.normal(0, 50, (count, 7))
    return Boxes(
        geometry,
        rng.integers(0, 4, count),
        tuple("x" * length for length in rng.integers(0, 9, count)),  # every alignment
        rng.normal(0, 10, (count, 3)),
    )


@pytest.mark.oracle
@pytest.mark.parametrize("count", [0, 1, 60])
@pytest.mark.parametrize("frame_id", ["map", "ego/lidar"])
def test_the_bytes_are_those_of_rosbags(count: int, frame_id: str) -> None:
    boxes = _boxes(count)
    assert detections_cdr(STAMP_NS, frame_id, boxes) == serialise(
        build.detections_message(STAMP_NS, frame_id, boxes), "vision_msgs/msg/Detection3DArray"
    )
    assert markers_cdr(STAMP_NS, frame_id, boxes) == serialise(
        markers(STAMP_NS, frame_id, boxes), "visualization_msgs/msg/MarkerArray"
    )
    points, occlusion = np.arange(count) * 1000, np.linspace(0, 1, count)
    expected = build.road_users(STAMP_NS, frame_id, boxes, points, occlusion)
    found = road_users_cdr(STAMP_NS, frame_id, boxes, points, occlusion)
    assert found == serialise(expected, "advpipe_msgs/msg/RoadUserArray")
