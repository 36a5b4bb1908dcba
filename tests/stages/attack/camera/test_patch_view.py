"""What pixels see of a patch: their share, the mix of its texels, and what hides it."""

from __future__ import annotations

import numpy as np
import pytest
from camera_scenes import BOX, fisheye, scene, with_pole

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.attack.camera.patch_place import PatchSize, VehicleRear
from advpipe.stages.attack.camera.patch_view import PatchView, patch_view
from advpipe.stages.attack.camera.scene import CameraScene

SIZE, TEXELS = PatchSize(1.0, 0.5), (4, 8)
REAR = VehicleRear("van", SIZE, 1.0)


def view_in(ahead: CameraScene, **keys: object) -> PatchView:
    return patch_view(ahead, REAR, TEXELS, **keys)  # type: ignore[arg-type]


def shown(view: PatchView, texture: Float64, shape: tuple[int, int]) -> Float64:
    image = np.zeros((shape[0] * shape[1], 3))
    image[view.pixels] = view.mixed(texture)
    return image.reshape(*shape, 3)


def test_it_covers_as_many_pixels_as_its_area() -> None:
    """(400 / 9.99)^2 pixels a square metre, half a square metre."""
    view = view_in(scene())
    assert view.cover.sum() == pytest.approx(0.5 * (400 / 9.99) ** 2, rel=0.02)
    mixed = np.bincount(view.rows, view.weights, len(view.pixels))
    assert mixed == pytest.approx(view.cover)


def test_a_texel_is_seen_at_its_place() -> None:
    """The texel in row 1 and column 6 of 4 x 8: its middle is 0.3125 m right, 0.0625 m above the middle."""
    texture = np.zeros((32, 3))
    texture[1 * 8 + 6] = 1.0
    light = shown(view_in(scene()), texture, (480, 640))[..., 0]
    rows, columns = np.mgrid[:480, :640]
    middle = (light * columns).sum() / light.sum(), (light * rows).sum() / light.sum()
    per_m = 400 / 9.99
    assert middle == pytest.approx((319.5 + 0.3125 * per_m, 239.5 + 0.4375 * per_m), abs=0.15)


def test_what_stands_before_it_hides_it() -> None:
    clean = scene()
    whole = view_in(clean)
    pole = with_pole(clean, slice(310, 320), 6.0)
    view = view_in(pole)
    hidden = np.isin(whole.pixels % 640, range(310, 320))
    assert hidden.sum() > 100
    assert view.pixels.tolist() == whole.pixels[~hidden].tolist()


def test_it_hides_what_stands_behind_it() -> None:
    """Where a pane lets rays pass, the image knows what is behind: the print is on the pane."""
    clean = scene()
    assert view_in(with_pole(clean, slice(310, 320), 14.0)).pixels.tolist() == view_in(clean).pixels.tolist()


def test_beyond_what_depth_tells_it_is_where_its_vehicle_is() -> None:
    far = scene(box=(82.0, *BOX[1:]))
    ranges = np.full(far.range_m.shape, np.nan)
    unknown = CameraScene(
        far.lens, ranges, far.tags, far.users, far.ids, far.boxes, far.base_SE3_optical, np.eye(4)
    )
    view = view_in(unknown)
    assert len(view.pixels) > 0
    assert far.pixels_of("van").ravel()[view.pixels].all()
    nobody = CameraScene(
        far.lens,
        ranges,
        far.tags,
        np.full_like(far.users, -1),
        (),
        far.boxes,
        far.base_SE3_optical,
        np.eye(4),
    )
    assert view_in(nobody).is_empty


def test_a_fisheye_bends_it() -> None:
    """Aside of the axis, the plane's right edge, a straight line, is a curve in the image."""
    aside = scene(fisheye(), (5.0, -2.5, 1.0, 4.0, 2.0, 2.0, 0.0))
    view = patch_view(aside, VehicleRear("van", PatchSize(1.0, 2.0), 1.5), (40, 20))
    rows = view.pixels // 640
    edge = np.array([(view.pixels[rows == row] % 640).max() for row in np.unique(rows)])
    assert len(edge) > 100
    straight = np.interp(np.arange(len(edge)), [0, len(edge) - 1], edge[[0, -1]])
    assert np.abs(edge - straight).max() > 3


def test_a_displaced_print_moves_and_grows() -> None:
    """Within the place that was measured for it."""
    texture = np.zeros((32, 3))
    texture[1 * 8 + 3] = 1.0
    columns = np.arange(640)
    places = []
    for keys in ({}, {"offset_m": (0.05, 0.0)}):
        light = shown(view_in(scene(), **keys), texture, (480, 640))[..., 0].sum(axis=0)
        places.append((light * columns).sum() / light.sum())
    assert places[1] - places[0] == pytest.approx(0.05 * 400 / 9.99, abs=0.1)
