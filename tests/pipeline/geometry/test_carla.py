"""CARLA's left-handed poses."""

import numpy as np
import pytest

from advpipe.pipeline.geometry.carla import carla_from_se3, se3_from_carla


def test_carla_s_poses_come_back():
    rng = np.random.default_rng(0)
    for pose in rng.uniform(-80, 80, (20, 6)):
        assert carla_from_se3(se3_from_carla(pose)) == pytest.approx(pose.tolist(), abs=1e-9)
    facing_right = se3_from_carla([0, 0, 0, 0, 90, 0])  # of CARLA: to its +y, which is right
    assert (facing_right @ [1, 0, 0, 1])[:3] == pytest.approx([0, -1, 0])
    nose_up = se3_from_carla([0, 0, 0, 0, 0, 10])
    assert (nose_up @ [1, 0, 0, 1])[2] > 0
