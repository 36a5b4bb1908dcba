"""How far points went: numbers by hand, of one cloud and over several."""

import numpy as np
import pytest

from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.stages.evaluate.detection.displacement import Displacement


def cloud(n=10):
    points = np.zeros(n, POINT_DTYPE)
    points["x"] = np.arange(n)
    points["time"] = np.arange(n)
    return points


def of(after):
    return Displacement.of(cloud(), after, cloud_difference(cloud(), after))


def test_moved_points_by_hand():
    after = cloud()
    after["y"][:4] = [3, 1, 1, 1]
    way = of(after)
    assert (way.count, way.mean_m, way.median_m, way.max_m) == (4, 1.5, 1.0, 3.0)
    assert way.rms_m == pytest.approx(np.sqrt(12 / 4))
    assert way.p95_m == pytest.approx(2.7)  # between 1 and 3, at 0.85 of the way
    assert way.max_added_m == 0.0


def test_added_points_by_hand():
    new = cloud(2)
    new["y"], new["time"] = [0.25, 2], 99
    way = of(np.concatenate([cloud(), new]))
    assert (way.count, way.max_added_m) == (0, 2.0)


def test_over_several_frames():
    one, other = cloud(), cloud()
    one["y"][:1] = 4
    other["y"][:3] = 2
    way = Displacement.over([of(one), of(other), Displacement(), Displacement(max_added_m=7.0)])
    assert (way.count, way.mean_m, way.max_m, way.max_added_m) == (4, 2.5, 4.0, 7.0)
    assert way.rms_m == pytest.approx(np.sqrt((16 + 3 * 4) / 4))
    assert way.median_m == way.p95_m == 3.0
    assert Displacement.over([Displacement()]) == Displacement()
