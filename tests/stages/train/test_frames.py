from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import count_points
from advpipe.pipeline.messages.cloud import xyzi
from advpipe.stages.train.frames import FrameStore, cropped


def test_frames_come_back_as_recorded(drive, tmp_path):
    store = FrameStore.build(
        (cropped(frame, 100.0) for frame in read_frames(drive)), tmp_path / "frames", "key"
    )
    assert len(store) == 6
    for i, frame in enumerate(read_frames(drive)):
        stored = store.frame(i)
        np.testing.assert_array_equal(stored.points, xyzi(frame.cloud))
        np.testing.assert_array_equal(stored.boxes, frame.boxes.geometry)
        np.testing.assert_array_equal(stored.labels, frame.boxes.labels)
        np.testing.assert_array_equal(stored.counts, count_points(stored.points, stored.boxes))


def test_objects_are_the_points_in_their_boxes(drive, tmp_path):
    store = FrameStore.build(
        (cropped(frame, 100.0) for frame in read_frames(drive)), tmp_path / "frames", "key"
    )
    for i in (0, 7, 23):
        points, box = store.object(i)
        np.testing.assert_array_equal(box, store.frame(i // 4).boxes[i % 4])
        assert len(points) == store.counts[i] == count_points(points, box)[0] > 300


def test_far_and_invalid_points_are_dropped(tmp_path, drive):
    frame = next(iter(read_frames(drive)))
    cloud = frame.cloud.copy()
    cloud["x"][0], cloud["y"][1] = 1000.0, np.nan
    store = FrameStore.build(
        (cropped(frame, 100.0) for frame in [type(frame)(0, 0, cloud, frame.boxes)]),
        tmp_path / "frames",
        "key",
    )
    assert len(store.frame(0).points) == len(cloud) - 2


def test_a_store_is_built_once_for_a_key(drive, tmp_path):
    FrameStore.build((cropped(frame, 100.0) for frame in read_frames(drive)), tmp_path / "frames", "a")
    assert len(FrameStore.build(iter(()), tmp_path / "frames", "a")) == 6
    with pytest.raises(AdvpipeError, match="no labelled clouds"):
        FrameStore.build(iter(()), tmp_path / "frames", "b")
    assert not list(tmp_path.glob(".*"))
