"""Road signs that patches are fixed to: where they stand, how large they are, and how they are seen later."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from camera_scenes import scene, with_pole

from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.stages.attack.camera.patch_place import PatchSize
from advpipe.stages.attack.camera.patch_sign import signs
from advpipe.stages.attack.camera.patch_view import patch_view
from advpipe.stages.attack.camera.scene import CameraScene

SIGN_M, SIDE_M = np.array([12.0, 3.0, 2.2]), 0.8
LARGEST = PatchSize(2.0, 2.0)


def with_sign(ahead_m: float = 0.0, lean: float = 0.0) -> CameraScene:
    """A square sign that faces the camera, 12 m ahead of the map's origin, 3 m left and 2.2 m high; the
    camera is so far ahead of that. lean: by how much its top is farther than its bottom, a metre."""
    clean = scene()
    width, height = clean.lens.size_px
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    rays = clean.lens.directions(np.column_stack([x.ravel(), y.ravel()])) @ clean.base_SE3_optical[:3, :3].T
    away_m = (SIGN_M[0] - ahead_m - lean * (SIGN_M[2] - 1.5)) / (rays[:, 0] - lean * rays[:, 2])
    places = rays * away_m[:, None] + (ahead_m, 0, 1.5)
    on = (np.abs(places - SIGN_M)[:, 1:] <= SIDE_M / 2).all(axis=1).reshape(height, width)
    pose = np.eye(4)
    pose[0, 3] = ahead_m
    return replace(
        clean,
        range_m=np.where(on, away_m.reshape(height, width), clean.range_m),
        tags=np.where(on, TAG["TrafficSign"], clean.tags).astype(np.uint8),
        users=np.where(on, -1, clean.users),
        map_SE3_base=pose,
    )


def test_a_sign_is_found_where_it_stands() -> None:
    (face,) = signs(with_sign(), LARGEST)
    assert face.map_SE3_patch[:3, 3] == pytest.approx(SIGN_M - (0.01, 0, 0), abs=0.02)
    assert face.map_SE3_patch[:3, 2] == pytest.approx([1, 0, 0], abs=1e-3)  # away from the camera
    assert face.map_SE3_patch[:3, 0] == pytest.approx([0, -1, 0], abs=1e-3)  # right, as one sees it
    assert (face.size.width_m, face.size.height_m) == pytest.approx(
        (0.72, 0.72), abs=0.06
    )  # a pixel is 0.03 m
    assert signs(with_sign(), PatchSize(0.3, 0.2))[0].size == PatchSize(0.3, 0.2)


def test_what_leans_or_is_far_is_no_sign_to_print_on() -> None:
    assert signs(with_sign(lean=0.5), LARGEST) == []
    assert signs(with_sign(ahead_m=-60), LARGEST) == []
    assert signs(scene(), LARGEST) == []


def test_the_patch_stays_on_its_sign() -> None:
    """4 m nearer, it covers (12 / 8)^2 times as many pixels, all of them the sign's."""
    (face,) = signs(with_sign(), LARGEST)
    near, far = with_sign(4.0), with_sign()
    views = [patch_view(each, face, (8, 8)) for each in (near, far)]
    assert views[0].cover.sum() / views[1].cover.sum() == pytest.approx((11.99 / 7.99) ** 2, rel=0.05)
    for view, each in zip(views, (near, far), strict=True):
        assert (each.tags.ravel()[view.pixels] == TAG["TrafficSign"]).all()


def test_what_stands_before_a_sign_hides_the_patch() -> None:
    (face,) = signs(with_sign(), LARGEST)
    columns = patch_view(with_sign(), face, (8, 8)).pixels % 640
    pole = slice(int(columns.min()) + 3, int(columns.min()) + 6)
    hidden = with_pole(with_sign(), pole, 5.0)
    hidden = replace(hidden, tags=np.where(hidden.range_m == 5.0, TAG["Pole"], hidden.tags).astype(np.uint8))
    shown = set((patch_view(hidden, face, (8, 8)).pixels % 640).tolist())
    assert shown == set(columns.tolist()) - set(range(640)[pole])
