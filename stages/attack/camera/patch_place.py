"""Where a patch is fixed: a rectangle on the plane of the rear of a vehicle's true box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.stages.attack.camera.scene import CameraScene

VEHICLES = tuple(CLASSES.index(name) for name in ("car", "truck"))
"""Classes with a rear that a patch can be fixed to."""

OFF_M = 0.01
"""Distance of the patch from the box's rear, so that rays meet it before the body."""


@dataclass(frozen=True)
class PatchSize:
    """width_m, height_m: of the rectangle. center_m: height of its middle above the road."""

    width_m: float
    height_m: float
    center_m: float


def base_SE3_patch(box: Float64, size: PatchSize) -> Float64:
    """The pose (4, 4) of a patch on the rear of a box (7,) in the vehicle's frame: x to the right as one sees
    it from behind, y down, z forward, into the vehicle; in its middle."""
    cos, sin = np.cos(box[6]), np.sin(box[6])
    forward, right = np.array([cos, sin, 0.0]), np.array([sin, -cos, 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, (0.0, 0.0, -1.0), forward
    up = np.array([0.0, 0.0, size.center_m - box[5] / 2])
    pose[:3, 3] = box[:3] - forward * (box[3] / 2 + OFF_M) + up
    return pose


def optical_SE3_patch(scene: CameraScene, box: Float64, size: PatchSize) -> Float64:
    """The same in the camera's optical frame."""
    pose: Float64 = invert(scene.base_SE3_optical) @ base_SE3_patch(box, size)
    return pose


def corners_px(scene: CameraScene, optical_SE3_patch: Float64, size: PatchSize) -> Float64:
    """Where the camera sees the corners (4, 2): top left, top right, bottom right, bottom left; NaN for those
    that it does not."""
    half = np.array([size.width_m, size.height_m]) / 2
    corners = np.zeros((4, 3))
    corners[:, :2] = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    return scene.lens.project(transform_points(optical_SE3_patch, corners))


def is_behind(optical_SE3_patch: Float64) -> bool:
    """Whether the camera is on the side of the patch that is printed."""
    return bool(optical_SE3_patch[:3, 2] @ optical_SE3_patch[:3, 3] > 0)


def candidates(scene: CameraScene, size: PatchSize) -> Sequence[str]:
    """The vehicles whose rear the camera is behind and that are visible in it, the nearest first."""
    found: list[tuple[float, str]] = []
    for box, label, name in zip(scene.boxes.geometry, scene.boxes.labels, scene.boxes.ids, strict=True):
        pose = optical_SE3_patch(scene, box, size)
        corners = corners_px(scene, pose, size)
        if label in VEHICLES and name in scene.ids and np.isfinite(corners).all() and is_behind(pose):
            found.append((float(np.linalg.norm(pose[:3, 3])), name))
    return [name for _, name in sorted(found)]


def plane_hits(
    lens_rays: Float64, optical_SE3_patch: Float64
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Where rays (N, 3) from the camera meet the plane of a patch: right and down (N, 2) in metres from its
    middle, and the range (N,); NaN for those that do not."""
    normal, middle = optical_SE3_patch[:3, 2], optical_SE3_patch[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (normal @ middle) / (lens_rays @ normal)
        range_m = np.where(range_m > 0, range_m, np.nan)
    away = lens_rays * range_m[:, None] - middle
    return away @ optical_SE3_patch[:3, :2], range_m
