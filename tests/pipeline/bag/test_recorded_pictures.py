"""Pictures and their labels as they were recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from picture_drive import CAMERA, START_NS, STEP_NS, painted, record_pictures, rectangles_at

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_pictures import (
    Picture,
    RecordedCamera,
    read_labels,
    read_pictures,
    read_visible_shares,
    recorded_cameras,
)
from advpipe.pipeline.bag.window import Window
from advpipe.pipeline.core.errors import AdvpipeError


def test_pictures_come_with_their_labels(tmp_path: Path) -> None:
    reader = BagReader(record_pictures(tmp_path / "clean", 3))
    (camera,) = recorded_cameras(reader)
    assert camera == RecordedCamera("ego", CAMERA)
    pictures, labels = list(read_pictures(reader, camera)), read_labels(reader, camera)
    assert [each.stamp_ns for each in pictures] == [START_NS + k * STEP_NS for k in range(3)] == list(labels)
    np.testing.assert_array_equal(pictures[1].rgb("here"), painted(rectangles_at(1)))
    assert [each.class_name for each in labels[START_NS]] == ["Car", "Pedestrian"]
    assert read_visible_shares(reader, camera)[START_NS] == {"user-0": 1.0, "user-1": 1.0}
    window = Window(START_NS + STEP_NS, START_NS + 2 * STEP_NS)
    assert [each.stamp_ns for each in read_pictures(reader, camera, window)] == [START_NS + STEP_NS]


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff\xe0 no picture", b"GIF89a"])
def test_a_broken_picture_is_refused_in_one_line(data: bytes) -> None:
    with pytest.raises(AdvpipeError, match=r"^bag: the picture at 7 ns is not a complete JPEG or PNG file$"):
        Picture(7, 8, data).rgb("bag")
