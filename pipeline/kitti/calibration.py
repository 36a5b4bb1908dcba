"""The calibration of a frame as KITTI's object benchmark writes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64, se3
from advpipe.pipeline.kitti.calibration_matrices import CalibrationFile
from advpipe.pipeline.kitti.number_lines import read_keyed_numbers

CAMERAS = (0, 1, 2, 3)
"""Two grey cameras and two in colour; labels are made in the images of camera 2, the left one in colour."""

LABELLED_CAMERA = 2

_FIX = "restore it from KITTI's calibration archive"


@dataclass(frozen=True)
class KittiCalibration:
    """How the LiDAR's points come to pixels: P_i @ R0_rect @ Tr_velo_to_cam.

    projections: P_i (3, 4) by camera, from the rectified frame of camera 0 to pixels. rectification_R:
    R0_rect (3, 3). camera_SE3_lidar: Tr_velo_to_cam (4, 4), to camera 0. lidar_SE3_imu: Tr_imu_to_velo, the
    same way.

    Both rotations are as exact as the seven digits of KITTI's files, so that their inverses are computed as
    those of any matrix, as OpenPCDet does.
    """

    projections: Mapping[int, Float64]
    rectification_R: Float64
    camera_SE3_lidar: Float64
    lidar_SE3_imu: Float64 = field(default_factory=lambda: np.eye(4))

    @property
    def rectified_SE3_lidar(self) -> Float64:
        """From the LiDAR's frame to the rectified frame of camera 0, in which labels are."""
        return se3(self.rectification_R, np.zeros(3)) @ self.camera_SE3_lidar

    @property
    def lidar_SE3_rectified(self) -> Float64:
        """The inverse."""
        return np.asarray(np.linalg.inv(self.rectified_SE3_lidar), np.float64)

    def image_P_lidar(self, camera: int = LABELLED_CAMERA) -> Float64:
        """The projection (3, 4) from the LiDAR's frame to a camera's pixels."""
        return self.projections[camera] @ self.rectified_SE3_lidar


def read_object_calibration(file: Path) -> KittiCalibration:
    """Read calib/NNNNNN.txt: P2, R0_rect and Tr_velo_to_cam are required. Raises AdvpipeError."""
    numbers = read_keyed_numbers(file)
    calibration = CalibrationFile(file, numbers, _FIX)
    keys = {camera: f"P{camera}" for camera in CAMERAS}
    written = {camera: key for camera, key in keys.items() if camera == LABELLED_CAMERA or key in numbers}
    projections = calibration.projections(written, LABELLED_CAMERA)
    rectification_R = calibration.rotation("R0_rect")
    camera_SE3_lidar = calibration.pose("Tr_velo_to_cam")
    calibration.refuse_camera_aside("Tr_velo_to_cam", rectification_R @ camera_SE3_lidar[:3, :3])
    imu = "Tr_imu_to_velo"
    lidar_SE3_imu = calibration.pose(imu) if calibration.has(imu) else np.eye(4)
    return KittiCalibration(projections, rectification_R, camera_SE3_lidar, lidar_SE3_imu)


def format_object_calibration(calibration: KittiCalibration) -> str:
    """The text of calib/NNNNNN.txt, with KITTI's thirteen digits; a missing camera has camera 2's values."""
    fallback = calibration.projections[LABELLED_CAMERA]
    lines = {f"P{camera}": calibration.projections.get(camera, fallback) for camera in CAMERAS}
    lines["R0_rect"] = calibration.rectification_R
    lines["Tr_velo_to_cam"] = calibration.camera_SE3_lidar[:3]
    lines["Tr_imu_to_velo"] = calibration.lidar_SE3_imu[:3]
    return "".join(
        f"{key}: {' '.join(f'{number:.12e}' for number in matrix.ravel())}\n" for key, matrix in lines.items()
    )
