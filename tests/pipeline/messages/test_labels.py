"""Labels that do not count or do not cover all: what is written is read again."""

import numpy as np

from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage
from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.messages.labels import (
    IgnoredBoxes,
    ImageLabel,
    coverage_from_message,
    coverage_message,
    image_labels_from_message,
    image_labels_message,
)
from advpipe.pipeline.messages.message_bounds import implausibility
from advpipe.pipeline.messages.types import serialise, typestore

COVERAGE = LabelCoverage(
    (ConvexRegion("view of camera_2", np.array([[1.0, 0, 0, -0.5], [0.1, 1, 0, 0]])),),
    (ConvexRegion("far", max_range_m=60.0), ConvexRegion("DontCare", np.array([[0.0, 0, 1, 2]]))),
)


def through_bytes(message, type_name):
    return typestore().deserialize_cdr(serialise(message, type_name), type_name)


def test_coverage_comes_back_as_it_was():
    message = through_bytes(coverage_message(7, "ego/lidar", COVERAGE), "advpipe_msgs/msg/LabelCoverage")
    assert (message.header.frame_id, message.header.stamp.nanosec) == ("ego/lidar", 7)
    read = coverage_from_message(message)
    for was, now in zip(COVERAGE.labelled + COVERAGE.ignored, read.labelled + read.ignored, strict=True):
        assert (now.name, now.max_range_m) == (was.name, was.max_range_m)
        assert np.array_equal(now.planes, was.planes)


def test_incomplete_planes_are_implausible():
    message = coverage_message(7, "ego/lidar", COVERAGE)
    assert implausibility("/c", "advpipe_msgs/msg/LabelCoverage", message) == ""
    message.labelled[0].planes = np.zeros(7)
    assert "7 numbers" in implausibility("/c", "advpipe_msgs/msg/LabelCoverage", message)
    message.labelled[0].planes = np.full(4, np.nan)
    assert "nan" in implausibility("/c", "advpipe_msgs/msg/LabelCoverage", message)


def test_image_labels_come_back_as_they_were():
    labels = (
        ImageLabel("a", "Car", (1.5, 2.5, 30.0, 40.25), 0.25, 2, -1.57),
        ImageLabel("", "DontCare", (0.0, 0.0, 5.0, 5.0)),
    )
    message = image_labels_message(7, "ego/camera_2", labels)
    assert image_labels_from_message(through_bytes(message, "advpipe_msgs/msg/ImageLabelArray")) == labels


def test_ignored_boxes_turn_with_their_frame():
    van = IgnoredBoxes(np.array([[1.0, 0, 0, 5, 2, 2, 0.5]]), ("Van",), ("7",))
    turned = van.transformed(se3_from_yaw((10.0, 0.0, 1.0), np.pi / 2))
    assert np.allclose(turned.geometry, [[10, 1, 1, 5, 2, 2, 0.5 + np.pi / 2]])
    assert (turned.class_names, turned.ids) == (("Van",), ("7",))
