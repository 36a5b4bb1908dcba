"""Where the patch is, by numbers worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from camera_scenes import BOX, scene

from advpipe.stages.attack.camera.patch_place import (
    PatchSize,
    VehicleRear,
    corners_px,
    is_behind,
    plane_hits,
    vehicles_ahead,
)

SIZE = PatchSize(1.0, 0.5)
REAR = VehicleRear("van", SIZE, 1.0)


def test_the_corners_are_where_a_pinhole_sees_them() -> None:
    """0.5 m to the left and 0.25 m below the axis, 9.99 m ahead: 400 / 9.99 pixels a metre."""
    ahead = scene()
    pose = REAR.optical_SE3_patch(ahead)
    assert pose is not None
    per_m = 400 / 9.99
    left, right = 319.5 - 0.5 * per_m, 319.5 + 0.5 * per_m
    top, bottom = 239.5 + 0.25 * per_m, 239.5 + 0.75 * per_m
    assert corners_px(ahead, pose, SIZE) == pytest.approx(
        np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
    )


def test_the_patch_turns_with_its_vehicle() -> None:
    """Across the way to the left: its rear is to the right of its middle, and faces right."""
    pose = REAR.base_SE3_patch(np.array([12.0, 0.0, 1.0, 4.0, 2.0, 2.0, np.pi / 2]))
    assert pose[:3, 3] == pytest.approx([12.0, -2.01, 1.0])
    assert pose[:3, 0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)  # seen from the right, ahead is right
    assert pose[:3, 2] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_a_vehicle_that_comes_shows_no_rear() -> None:
    towards = scene(box=(*BOX[:6], np.pi))
    pose = REAR.optical_SE3_patch(towards)
    assert pose is not None
    assert not is_behind(pose)
    assert vehicles_ahead(towards, SIZE, 1.0) == []
    assert vehicles_ahead(scene(), SIZE, 1.0) == [REAR]


def test_rays_meet_the_plane_where_the_lens_looks() -> None:
    ahead = scene()
    pose = REAR.optical_SE3_patch(ahead)
    assert pose is not None
    rays = ahead.lens.directions(corners_px(ahead, pose, SIZE))
    where_m, range_m = plane_hits(rays, pose)
    assert where_m == pytest.approx(np.array([(-0.5, -0.25), (0.5, -0.25), (0.5, 0.25), (-0.5, 0.25)]))
    assert range_m[0] == pytest.approx(np.sqrt(9.99**2 + 0.5**2 + 0.25**2))
    assert np.isnan(plane_hits(-rays, pose)[1]).all()
