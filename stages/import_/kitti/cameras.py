"""What KITTI's calibration says of the cameras: views, mounts, and the part of space that camera 2 shows."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.regions import ConvexRegion, LabelCoverage, image_region
from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.kitti.calibration import LABELLED_CAMERA, KittiCalibration
from advpipe.pipeline.kitti.object_label import ObjectLabel
from advpipe.pipeline.messages.labels import ImageLabel
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.import_.drive import CameraView

USUAL_SIZE_PX = (1242, 375)
"""Width and height of most of KITTI's pictures."""

LIDAR_HEIGHT_M = 1.73
"""Of KITTI's LiDAR above the ground, as its sensor setup states."""

_EGO = VehicleTopics()
_PNG = struct.Struct(">8s8xII")
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def camera_name(camera: int) -> str:
    """The name of a camera by KITTI's number."""
    return f"camera_{camera}"


def lidar_mount(height_m: float | None) -> tuple[str, str, Float64]:
    """Base, LiDAR and base_SE3_lidar: the base lies on the ground below the LiDAR."""
    height_m = LIDAR_HEIGHT_M if height_m is None else height_m
    return _EGO.base_frame, _EGO.lidar_frame, se3(np.eye(3), [0.0, 0.0, height_m])


def camera_mounts(calibration: KittiCalibration) -> list[tuple[str, str, Float64]]:
    """LiDAR, camera and lidar_SE3_camera of each camera, turned as camera 0 is before its rectification.

    The optical centre of camera i lies where its projection has no image; the rotations of the others before
    their rectification are known in raw drives alone, whose pictures are rectified too.
    """
    mounts = []
    for camera, matrix_P in sorted(calibration.projections.items()):
        centre = -np.linalg.solve(matrix_P[:, :3], matrix_P[:, 3])
        camera0_SE3_camera = se3(np.eye(3), calibration.rectification_R.T @ centre)
        lidar_SE3_camera = np.linalg.inv(calibration.camera_SE3_lidar) @ camera0_SE3_camera
        mounts.append((_EGO.lidar_frame, _EGO.sensor_frame(camera_name(camera)), lidar_SE3_camera))
    return mounts


def camera_views(
    calibration: KittiCalibration, size_px: tuple[int, int], labels: tuple[ImageLabel, ...] | None = None
) -> dict[str, CameraView]:
    """The view of each camera by its name. labels: those of camera 2."""
    width_px, height_px = size_px
    return {
        camera_name(camera): CameraView(
            width_px,
            height_px,
            matrix_P[:, :3],
            matrix_P,
            calibration.rectification_R,
            labels=labels if camera == LABELLED_CAMERA else None,
        )
        for camera, matrix_P in sorted(calibration.projections.items())
    }


def label_coverage(
    calibration: KittiCalibration, size_px: tuple[int, int], dont_care: Sequence[ObjectLabel] = ()
) -> LabelCoverage:
    """What camera 2 shows is labelled, except what lies in one of the `dont_care` rectangles."""
    image_P_lidar = calibration.image_P_lidar()
    width_px, height_px = size_px
    ignored: list[ConvexRegion] = [
        image_region(each.class_name, image_P_lidar, *each.edges_px) for each in dont_care
    ]
    labelled = image_region(camera_name(LABELLED_CAMERA), image_P_lidar, 0, 0, width_px, height_px)
    return LabelCoverage((labelled,), tuple(ignored))


def picture_size(file: Path) -> tuple[int, int] | None:
    """Width and height in pixels from the header of a PNG file; None if there is no file.

    Raises AdvpipeError for a file that is no PNG.
    """
    try:
        with file.open("rb") as opened:
            start = opened.read(_PNG.size)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise AdvpipeError(f"{file}: cannot be read: {error.strerror or error}") from None
    if len(start) == _PNG.size:
        signature, width_px, height_px = _PNG.unpack(start)
        if signature == _PNG_SIGNATURE and width_px and height_px:
            return width_px, height_px
    raise AdvpipeError(f"{file}: is no PNG picture, or is truncated; restore or remove it")
