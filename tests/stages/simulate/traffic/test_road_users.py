"""Road users as seen from above."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.stages.simulate.traffic.road_users import footprints


def test_footprint_of_a_car_heading_north() -> None:
    corners = footprints(se3_from_yaw([1, 2, 0], np.pi / 2)[None], [(4.0, 2.0)])[0]
    assert np.sort(corners, axis=0) == pytest.approx(np.array([[0, 0], [0, 0], [2, 4], [2, 4]]))
