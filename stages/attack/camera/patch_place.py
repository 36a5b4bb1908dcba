"""What a patch is fixed to, and where: the rear of a vehicle's true box, or the face of a road sign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.stages.attack.camera.scene import CameraScene

Mask = npt.NDArray[np.bool_]

VEHICLES = tuple(CLASSES.index(name) for name in ("car", "truck"))
"""Classes with a rear that a patch can be fixed to."""

OFF_M = 0.01
"""Distance of the patch from the surface under it, so that rays meet it before."""


@dataclass(frozen=True)
class PatchSize:
    """width_m, height_m: of the rectangle."""

    width_m: float
    height_m: float


class Carrier(Protocol):
    """What a patch is fixed to. name: of the road user, "" for none. size: of the patch. is_sticker: whether
    it is seen on the carrier alone, not over its edge, as a board would be."""

    @property
    def name(self) -> str: ...

    @property
    def size(self) -> PatchSize: ...

    is_sticker: ClassVar[bool]

    def optical_SE3_patch(self, scene: CameraScene) -> Float64 | None:
        """The pose (4, 4) of the patch in the camera's optical frame: x to the right as one sees it, y down,
        z away, into what it is fixed to; in its middle. None where the scene does not know it."""

    def own(self, scene: CameraScene) -> Mask:
        """The pixels (H, W) of what it is fixed to."""


@dataclass(frozen=True)
class VehicleRear:
    """The plane of the rear of a vehicle's true box. center_m: height of the patch's middle above the
    road."""

    name: str
    size: PatchSize
    center_m: float

    is_sticker: ClassVar[bool] = False

    def base_SE3_patch(self, box: Float64) -> Float64:
        """The pose (4, 4) on a box (7,), in the frame of this."""
        cos, sin = np.cos(box[6]), np.sin(box[6])
        forward = np.array([cos, sin, 0.0])
        up = np.array([0.0, 0.0, self.center_m - box[5] / 2])
        return upright_pose(box[:3] - forward * box[3] / 2 + up, forward)

    def optical_SE3_patch(self, scene: CameraScene) -> Float64 | None:
        box = scene.box_of(self.name)
        return None if box is None else invert(scene.base_SE3_optical) @ self.base_SE3_patch(box)

    def own(self, scene: CameraScene) -> Mask:
        return scene.pixels_of(self.name)


@dataclass(frozen=True)
class SignFace:
    """A place in the map, on the face of a road sign. map_SE3_patch: (4, 4)."""

    map_SE3_patch: Float64
    size: PatchSize
    name: str = ""

    is_sticker: ClassVar[bool] = True

    def optical_SE3_patch(self, scene: CameraScene) -> Float64 | None:
        pose: Float64 = invert(scene.map_SE3_base @ scene.base_SE3_optical) @ self.map_SE3_patch
        return pose

    def own(self, scene: CameraScene) -> Mask:
        found: Mask = scene.tags == TAG["TrafficSign"]
        return found


def upright_pose(middle_m: Float64, away: Float64) -> Float64:
    """A pose (4, 4) that looks along a level unit vector (3,), y down, just before a place (3,)."""
    down = np.array([0.0, 0.0, -1.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = np.cross(down, away), down, away
    pose[:3, 3] = middle_m - away * OFF_M
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


def vehicles_ahead(scene: CameraScene, size: PatchSize, center_m: float) -> Sequence[VehicleRear]:
    """The vehicles whose rear the camera is behind and that are visible in it, the nearest first."""
    found: list[tuple[float, str]] = []
    for label, name in zip(scene.boxes.labels, scene.boxes.ids, strict=True):
        pose = VehicleRear(name, size, center_m).optical_SE3_patch(scene)
        if label not in VEHICLES or name not in scene.ids or pose is None or not is_behind(pose):
            continue
        if np.isfinite(corners_px(scene, pose, size)).all():
            found.append((float(np.linalg.norm(pose[:3, 3])), name))
    return [VehicleRear(name, size, center_m) for _, name in sorted(found)]


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
