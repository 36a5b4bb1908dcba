"""Sequences of KITTI's odometry benchmark: clouds, times and poses, without objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.kitti.calibration import CAMERAS, LABELLED_CAMERA, KittiCalibration
from advpipe.pipeline.kitti.calibration_matrices import CalibrationFile
from advpipe.pipeline.kitti.number_lines import read_keyed_numbers, read_number_rows
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.folders import numbered_clouds, read_cloud, stray_notes
from advpipe.stages.import_.kitti import cameras
from advpipe.stages.import_.kitti.choose import chosen_folder, refuse_options
from advpipe.stages.import_.options import ImportOptions

_FIX = "restore it from KITTI's odometry archives"


class OdometrySequence:
    """One sequence, with the poses where they are published (00 to 10).

    Its map starts at the base of the first frame: x forward, y left, z along the LiDAR's z, not exactly up.
    """

    are_related = True

    def __init__(self, source: Path, options: ImportOptions) -> None:
        """Reads calibration, times and poses. Raises UsageError."""
        refuse_options(options, "odometry sequences")
        if options.classes:
            raise UsageError(
                "--class means nothing to KITTI's odometry sequences, which have no objects; leave it out"
            )
        self._folder = chosen_folder(source, _sequences(source), options.drive)
        self._options = options
        number = self._folder.resolve().name
        self.name = f"sequence {number}"
        self._numbers = numbered_clouds(self._folder / "velodyne", 6)
        self._calibration = _read_calibration(self._folder / "calib.txt")
        times = read_number_rows(self._folder / "times.txt", 1, _FIX)
        self._stamps_ns = [round(float(time_s) * 1e9) for time_s in times[:, 0]]
        poses = self._folder.resolve().parent.parent / "poses" / f"{number}.txt"
        self._poses = read_number_rows(poses, 12, _FIX) if poses.is_file() else None
        for file, rows in (("times.txt", times), (f"poses/{number}.txt", self._poses)):
            if rows is not None and len(rows) <= self._numbers[-1]:
                raise AdvpipeError(
                    f"{self._folder}: {file} has {len(rows)} lines, but there is a cloud "
                    f"{self._numbers[-1]:06d}.bin; restore both from KITTI's odometry archives"
                )
        mount = cameras.lidar_mount(options.lidar_height_m)
        self.static_transforms = [mount, *cameras.camera_mounts(self._calibration)]
        self._base_SE3_camera = mount[2] @ self._calibration.lidar_SE3_rectified
        self._size_px = cameras.picture_size(self._folder / "image_2" / f"{self._numbers[0]:06d}.png")

    @property
    def frame_count(self) -> int:
        """The number of clouds."""
        return len(self._numbers)

    @property
    def notes(self) -> Sequence[str]:
        """What was assumed, and what is missing."""
        notes = ["sequences have no objects: there is nothing for a detector to find"]
        notes += stray_notes(self._folder / "velodyne", ".bin")
        if self._poses is None:
            notes.append("no poses: KITTI publishes those of the sequences 00 to 10")
        if self._size_px is None:
            width_px, height_px = cameras.USUAL_SIZE_PX
            notes.append(f"no picture in image_2: taken as {width_px} x {height_px} pixels")
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The frames from the index `first` on."""
        views = cameras.camera_views(self._calibration, self._size_px or cameras.USUAL_SIZE_PX)
        for number in self._numbers[first:]:
            file = self._folder / "velodyne" / f"{number:06d}.bin"
            cloud = read_cloud(file, self._options.scale_intensity)
            vehicle = VehicleFrame({"lidar": cloud}, map_SE3_base=self._pose(number), cameras=views)
            yield DriveFrame(str(file), self._stamps_ns[number], {"ego": vehicle}, file.stem)

    def _pose(self, number: int) -> Float64 | None:
        """map_SE3_base: KITTI's poses are those of camera 0, rectified, from its first frame."""
        if self._poses is None:
            return None
        first_SE3_camera = np.vstack([self._poses[number].reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
        first_SE3_base = self._base_SE3_camera @ first_SE3_camera @ np.linalg.inv(self._base_SE3_camera)
        return np.asarray(first_SE3_base, np.float64)


def _sequences(source: Path) -> dict[str, Path]:
    if (source / "velodyne").is_dir():
        return {source.resolve().name: source}
    folders = [
        folder for folder in sorted((source / "sequences").iterdir()) if (folder / "velodyne").is_dir()
    ]
    if not folders:
        raise UsageError(f"{source / 'sequences'} has no NN/velodyne; unpack KITTI's velodyne archive there")
    return {folder.name: folder for folder in folders}


def _read_calibration(file: Path) -> KittiCalibration:
    """calib.txt: P0 to P3, and Tr from the LiDAR to the rectified camera 0."""
    if not file.is_file():
        raise UsageError(f"{file} is missing; {_FIX}")
    numbers = read_keyed_numbers(file)
    key = "Tr" if "Tr" in numbers else "Tr_velo_to_cam"
    calibration = CalibrationFile(file, numbers, _FIX)
    camera_SE3_lidar = calibration.pose(key)
    calibration.refuse_camera_aside(key, camera_SE3_lidar[:3, :3])
    keys = {camera: f"P{camera}" for camera in CAMERAS}
    projections = calibration.projections(keys, LABELLED_CAMERA)
    return KittiCalibration(projections, np.eye(3), camera_SE3_lidar)
