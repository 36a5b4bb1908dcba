"""Poses from SUMO's front bumper and back again, on slopes too."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.stages.simulate.traffic.sumo.pose import base_poses, front_of


def test_a_car_that_climbs_east() -> None:
    """5 m long on a slope of 3 in 4: its middle lies 2.5 m behind its bumper, 2 m along x and 1.5 m down."""
    slope_deg = np.rad2deg(np.arctan2(3, 4))
    (pose,) = base_poses([[10, 0, 6]], [90.0], [slope_deg], [5.0])
    assert pose[:3, 3] == pytest.approx([8.0, 0.0, 4.5])
    assert pose[:3, 0] == pytest.approx([0.8, 0.0, 0.6])
    assert pose[:3, 2] == pytest.approx([-0.6, 0.0, 0.8])


@pytest.mark.parametrize("yaw_rad", [-3.0, -1.2, 0.0, 0.4, 2.8])
@pytest.mark.parametrize("pitch_rad", [-0.3, 0.0, 0.25])
def test_pose_conversion_is_invertible(yaw_rad: float, pitch_rad: float) -> None:
    pose = se3_from_yaw([3.0, -4.0, 5.0], yaw_rad, pitch_rad)
    front_m, angle_deg, slope_deg = front_of(pose, 4.6)
    (again,) = base_poses([front_m], [angle_deg], [slope_deg], [4.6])
    assert again == pytest.approx(pose, abs=1e-12)
    assert front_m == pytest.approx((pose @ [2.3, 0, 0, 1])[:3])


def test_north_is_zero_and_east_is_ninety() -> None:
    assert front_of(se3_from_yaw([0, 0, 0], np.pi / 2), 4.0)[1] == pytest.approx(0.0, abs=1e-9)
    assert front_of(se3_from_yaw([0, 0, 0], 0.0), 4.0)[1] == pytest.approx(90.0)
