"""Scenes by hand: one vehicle straight ahead of a camera, on an empty plain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.sensors.camera.lens import Lens, lens_of
from advpipe.pipeline.sensors.camera.rig import BASE_R_OPTICAL
from advpipe.stages.attack.camera.scene import CameraScene

CAMERA_M = (0.0, 0.0, 1.5)
BOX = (12.0, 0.0, 1.0, 4.0, 2.0, 2.0, 0.0)
"""Its rear is 10 m ahead."""


def pinhole(focal_px: float = 400.0) -> Lens:
    """640 x 480, axis in the middle."""
    return lens_of(
        "pinhole", (640, 480), np.array([[focal_px, 0, 319.5], [0, focal_px, 239.5], [0, 0, 1.0]]), ()
    )


def fisheye() -> Lens:
    return lens_of("fisheye", (640, 480), np.array([[300.0, 0, 319.5], [0, 300.0, 239.5], [0, 0, 1.0]]), ())


def scene(lens: Lens | None = None, box: tuple[float, ...] = BOX) -> CameraScene:
    """The rear of `van` fills the pixels that its box's rear projects to, 10 m ahead; the rest is far."""
    lens = lens or pinhole()
    width, height = lens.size_px
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = BASE_R_OPTICAL, CAMERA_M
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    rays = lens.directions(np.column_stack([x.ravel(), y.ravel()]))
    rear_m = box[0] - box[3] / 2
    away_m = rear_m / rays[:, 2]
    points = rays * away_m[:, None]
    on = (np.abs(points[:, 0] + box[1]) <= box[4] / 2) & (points[:, 1] <= CAMERA_M[2])
    on &= (points[:, 1] >= CAMERA_M[2] - box[5]) & (rays[:, 2] > 0)
    shape = height, width
    return CameraScene(
        lens,
        np.where(on, away_m, np.nan).reshape(shape),
        np.where(on, 14, 11).astype(np.uint8).reshape(shape),
        np.where(on, 0, -1).astype(np.int32).reshape(shape),
        ("van",),
        Boxes(np.array([box]), np.array([0]), ("van",), np.zeros((1, 3))),
        pose,
        np.eye(4),
    )


def with_pole(clean: CameraScene, columns: slice, range_m: float) -> CameraScene:
    """Something of nobody's stands before the vehicle in these columns."""
    ranges, users = clean.range_m.copy(), clean.users.copy()
    ranges[:, columns], users[:, columns] = range_m, -1
    return replace(clean, range_m=ranges, users=users)
