"""What would be seen of a road user if nothing were before it."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import se3
from advpipe.pipeline.sensors.camera.lens import lens_of
from advpipe.pipeline.sensors.camera.rig import BASE_R_OPTICAL
from advpipe.stages.simulate.world.carla.boxes import entry_m
from advpipe.stages.simulate.world.carla.silhouettes import silhouettes

SIZE_PX = 40, 30
MATRIX = np.array([[20.0, 0, 19.5], [0, 20.0, 14.5], [0, 0, 1]])
X, Y = np.meshgrid(np.arange(40.0), np.arange(30.0))
RAYS = lens_of("pinhole", SIZE_PX, MATRIX, ()).directions(np.column_stack([X.ravel(), Y.ravel()]))
OPTICAL = se3(BASE_R_OPTICAL, (0, 0, 0))
BOX = np.array([12.0, 0.0, 0.0, 4.0, 6.0, 3.0, 0.0])


def boxes(*geometry: np.ndarray) -> Boxes:
    count = len(geometry)
    return Boxes(
        np.array(geometry), np.zeros(count, np.int64), tuple(map(str, range(count))), np.zeros((count, 3))
    )


def scene(hidden_columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Ranges and objects of a body that fills its box, whose left columns a wall at 5 m hides."""
    enter_m = entry_m(np.zeros(3), RAYS @ OPTICAL[:3, :3].T, BOX)
    objects = np.where(np.isfinite(enter_m), 0, -1).astype(np.int32)
    range_m = enter_m.astype(np.float32)
    wall = np.zeros((30, 40), np.bool_)
    first = int(np.flatnonzero((objects.reshape(30, 40) >= 0).any(axis=0))[0])
    wall[:, : first + hidden_columns] = True
    objects[wall.ravel()] = -1
    range_m[wall.ravel()] = 5.0
    return range_m, objects


@pytest.mark.parametrize(("columns", "share"), [(0, 1.0), (3, 0.75), (6, 0.5), (12, 0.0)])
def test_the_hidden_share_is_that_of_the_box(columns: int, share: float) -> None:
    range_m, objects = scene(columns)
    visible, alone, visible_px, alone_px = silhouettes(SIZE_PX, RAYS, range_m, objects, boxes(BOX), OPTICAL)
    assert visible[0] / alone[0] == pytest.approx(share)
    assert alone_px[0].tolist() == [14, 12, 25, 17]
    if share:
        assert visible_px[0].tolist() == [14 + columns, 12, 25, 17]


def test_a_box_beside_the_camera_or_behind_it_is_not_in_the_image() -> None:
    range_m, objects = np.full(1200, np.inf, np.float32), np.full(1200, -1, np.int32)
    behind, beside = BOX * (-1, 1, 1, 1, 1, 1, 1), BOX + (0, 40, 0, 0, 0, 0, 0)
    around = np.array([0.0, 0.0, 0.0, 4.0, 2.0, 2.0, 0.3])
    _, alone, _, alone_px = silhouettes(
        SIZE_PX, RAYS, range_m, objects, boxes(behind, beside, around), OPTICAL
    )
    assert alone.tolist() == [0, 0, 0]
    assert (alone_px == -1).all()


def test_rays_enter_boxes() -> None:
    turned = np.array([5.0, 5.0, 0.0, 2.0, 2.0, 2.0, np.pi / 4])
    directions = np.array([[1.0, 0, 0], [0, 1.0, 0], [-1.0, 0, 0], [0.0, 0.0, 1.0]])
    found = entry_m(np.array([0.0, 5.0, 0.5]), directions, turned)
    assert found[0] == pytest.approx(5 - np.sqrt(2))
    assert np.isinf(found[1:]).all()
    assert entry_m(np.array([5.0, 5.0, 0.0]), directions, turned) == pytest.approx(0.0)  # from within
