"""The part of a cloud that a search looks at."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.adversary.focus import SURROUNDINGS_M, Focus

CAR = [4.0, 2.0, 1.5]


def test_what_is_shown_lies_around_open_objects():
    boxes = np.array([[0.0, 0.0, 0.0, *CAR, 0.0], [40.0, 0.0, 0.0, *CAR, np.pi / 2]])
    near, far = SURROUNDINGS_M + 2, SURROUNDINGS_M + 2.1
    points = np.array(
        [[near, 0, 0, 0], [far, 0, 0, 0], [40, near, 0, 0], [40, far, 0, 0], [0] * 4], np.float32
    )
    focus = Focus(points, boxes)
    assert focus.shown.tolist() == [0, 2, 4]
    focus.close(np.array([False, True]))
    assert focus.shown.tolist() == [0, 4]
    focus.close(np.array([True, False]))
    assert focus.shown.tolist() == []
    assert not focus.is_open.any()
