"""KITTI's raw drives: clouds with time stamps, poses from OXTS, tracklets."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.document import read_text
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.geometry.transforms import Float64, invert, se3, transform_points
from advpipe.pipeline.kitti.calibration import CAMERAS, LABELLED_CAMERA, KittiCalibration
from advpipe.pipeline.kitti.calibration_matrices import CalibrationFile
from advpipe.pipeline.kitti.number_lines import read_keyed_numbers
from advpipe.pipeline.kitti.object_label import camera_box, observation_angle
from advpipe.pipeline.kitti.projection import project_box
from advpipe.pipeline.messages.labels import IgnoredBoxes, ImageLabel
from advpipe.stages.import_.drive import DriveFrame, VehicleFrame
from advpipe.stages.import_.folders import numbered_clouds, read_cloud, stray_notes
from advpipe.stages.import_.kitti import cameras
from advpipe.stages.import_.kitti.choose import chosen_folder, refuse_options
from advpipe.stages.import_.kitti.oxts import OxtsPoses
from advpipe.stages.import_.kitti.tracklets import Tracklet, at_frame, read_tracklets
from advpipe.stages.import_.options import DROPPED, IGNORED, ImportOptions

VELOCITY_FRAMES = 5
"""A velocity is the difference of the positions so many frames before and after: a second apart, since the
boxes are placed by hand, some decimetres off."""

_CALIBRATION_FIX = "unpack the date's calibration archive (DATE_calib.zip) there"
_STAMP = re.compile(r"(\d{4}-\d\d-\d\d) (\d\d:\d\d:\d\d(?:\.\d{1,9})?)")


def raw_drives(source: Path) -> dict[str, Path]:
    """The synchronised drives at, in or two levels below a folder, by their names."""
    if (source / "velodyne_points").is_dir():
        return {source.resolve().name: source}
    folders = [*source.glob("*_drive_*_sync"), *source.glob("*/*_drive_*_sync")]
    return {folder.name: folder for folder in sorted(folders) if folder.is_dir()}


class RawDrive:
    """A synchronised and rectified raw drive."""

    are_related = True

    def __init__(self, source: Path, options: ImportOptions, classes: Mapping[str, str]) -> None:
        """Reads the calibration, the time stamps and the tracklets. Raises UsageError."""
        refuse_options(options, "raw drives")
        self._folder = chosen_folder(source, raw_drives(source), options.drive)
        self._options, self._classes = options, classes
        self.name = self._folder.resolve().name
        self._numbers = numbered_clouds(self._folder / "velodyne_points" / "data", 10)
        self._known = frozenset(self._numbers)
        self._stamps_ns = _time_stamps(self._folder / "velodyne_points" / "timestamps.txt", self._numbers[-1])
        self._calibration, self._size_px = _read_calibration(self._folder.resolve().parent)
        mount = cameras.lidar_mount(options.lidar_height_m)
        self.static_transforms = [mount, *cameras.camera_mounts(self._calibration)]
        self._base_SE3_lidar = mount[2]
        has_poses = (self._folder / "oxts").is_dir()
        self._oxts = OxtsPoses(self._folder / "oxts", self._numbers[0]) if has_poses else None
        self._map_SE3_lidar = lru_cache(4 * VELOCITY_FRAMES)(self._uncached_map_SE3_lidar)
        self._tracklets = self._read_tracklets(self._folder / "tracklet_labels.xml")

    @property
    def frame_count(self) -> int:
        """The number of clouds."""
        return len(self._numbers)

    @property
    def notes(self) -> Sequence[str]:
        """What was assumed, and what is missing."""
        notes = ["time stamps, which KITTI gives in local time, are taken as UTC"]
        notes += stray_notes(self._folder / "velodyne_points" / "data", ".bin")
        if missing := self._numbers[-1] - self._numbers[0] + 1 - len(self._numbers):
            notes.append(f"clouds missing in between: {missing}")
        if self._oxts is None:
            notes.append("no folder oxts: the poses of the vehicle are unknown")
        if self._tracklets is None:
            notes.append("no tracklet_labels.xml: the drive has no ground truth")
        else:
            notes.append("objects count where camera 2 sees them")
        return notes

    def frames(self, first: int = 0) -> Iterator[DriveFrame]:
        """The frames from the index `first` on."""
        for number in self._numbers[first:]:
            file = self._file(number)
            yield DriveFrame(str(file), self._stamps_ns[number], {"ego": self._vehicle(number)}, file.stem)

    def class_names(self) -> Collection[str]:
        """The classes of the tracklets."""
        file = self._folder / "tracklet_labels.xml"
        return {each.class_name for each in read_tracklets(file)} if file.is_file() else ()

    def _file(self, number: int) -> Path:
        return self._folder / "velodyne_points" / "data" / f"{number:010d}.bin"

    def _vehicle(self, number: int) -> VehicleFrame:
        clouds = {"lidar": read_cloud(self._file(number), self._options.scale_intensity)}
        pose = None
        if self._oxts is not None:
            pose = self._map_SE3_lidar(number) @ invert(self._base_SE3_lidar)
        if self._tracklets is None:
            views = cameras.camera_views(self._calibration, self._size_px)
            return VehicleFrame(clouds, map_SE3_base=pose, cameras=views)
        present = list(at_frame(self._tracklets, number))
        counted = [each for each in present if self._classes[each[0].class_name] != IGNORED]
        ignored = [each for each in present if self._classes[each[0].class_name] == IGNORED]
        labels = tuple(self._image_labels(present))
        return VehicleFrame(
            clouds,
            self._boxes(counted, number),
            ignored=IgnoredBoxes(
                _geometry(ignored),
                tuple(tracklet.class_name for tracklet, _ in ignored),
                tuple(tracklet.id for tracklet, _ in ignored),
            ),
            coverage=cameras.label_coverage(self._calibration, self._size_px),
            map_SE3_base=pose,
            cameras=cameras.camera_views(self._calibration, self._size_px, labels),
        )

    def _boxes(self, counted: Sequence[tuple[Tracklet, int]], number: int) -> Boxes:
        labels = [CLASSES.index(self._classes[tracklet.class_name]) for tracklet, _ in counted]
        velocity_mps = [self._velocity(tracklet, number) for tracklet, _ in counted]
        return Boxes(
            _geometry(counted),
            np.array(labels, np.int64),
            tuple(tracklet.id for tracklet, _ in counted),
            np.array(velocity_mps, np.float64).reshape(-1, 3),
        )

    def _velocity(self, tracklet: Tracklet, number: int) -> Float64:
        """Over ground, along the axes of the LiDAR's frame; unknown without poses and for a single frame."""
        span = range(number - VELOCITY_FRAMES, number + VELOCITY_FRAMES + 1)
        frames = [frame for frame in span if frame in self._known and tracklet.place(frame) is not None]
        if self._oxts is None or len(frames) < 2:
            return np.full(3, np.nan)
        first, last = (
            transform_points(self._map_SE3_lidar(frame), tracklet.boxes[frame - tracklet.first_frame, :3])
            for frame in (frames[0], frames[-1])
        )
        elapsed_s = (self._stamps_ns[frames[-1]] - self._stamps_ns[frames[0]]) / 1e9
        velocity_mps: Float64 = self._map_SE3_lidar(number)[:3, :3].T @ (last - first) / elapsed_s
        return velocity_mps

    def _image_labels(self, present: Sequence[tuple[Tracklet, int]]) -> Iterator[ImageLabel]:
        """The objects in camera 2's image; their rectangles are those of the boxes, projected."""
        image_P_lidar = self._calibration.image_P_lidar()
        for tracklet, place in present:
            rectangle = project_box(image_P_lidar, tracklet.boxes[place], *self._size_px)
            if rectangle is not None:
                _, bottom_m, rotation_y_rad = camera_box(tracklet.boxes[place], self._calibration)
                yield ImageLabel(
                    tracklet.id,
                    tracklet.class_name,
                    rectangle.edges_px,
                    rectangle.truncation,
                    tracklet.occlusion[place],
                    observation_angle(bottom_m, rotation_y_rad),
                )

    def _uncached_map_SE3_lidar(self, number: int) -> Float64:
        assert self._oxts is not None
        return self._oxts.map_SE3_imu(number) @ invert(self._calibration.lidar_SE3_imu)

    def _read_tracklets(self, file: Path) -> list[Tracklet] | None:
        if not file.is_file():
            return None
        tracklets = read_tracklets(file)
        for each in tracklets:
            if each.class_name not in self._classes:
                raise UsageError(
                    f"{file}: unknown class {each.class_name!r}; say what it is: "
                    f"--class '{each.class_name}=car' (or one of {', '.join(CLASSES)}, {IGNORED}, {DROPPED})"
                )
        return [each for each in tracklets if self._classes[each.class_name] != DROPPED]


def _geometry(present: Sequence[tuple[Tracklet, int]]) -> Float64:
    return np.array([tracklet.boxes[place] for tracklet, place in present], np.float64).reshape(-1, 7)


def _time_stamps(file: Path, last: int) -> list[int]:
    """Nanoseconds since the epoch of each frame, by its number. Raises AdvpipeError."""
    stamps_ns = []
    for number, line in enumerate(read_text(file).splitlines(), 1):
        match = _STAMP.fullmatch(line.strip())
        if line.strip() and match is None:
            raise AdvpipeError(
                f"{file}: line {number} is no time stamp; restore the file from the drive's archive"
            )
        # A frame without a cloud has an empty line.
        stamps_ns.append(int(np.datetime64("T".join(match.groups()), "ns").astype(np.int64)) if match else -1)
    if len(stamps_ns) <= last:
        raise AdvpipeError(
            f"{file}: {len(stamps_ns)} time stamps, but there is a cloud {last:010d}.bin; restore both from "
            "the drive's archive"
        )
    return stamps_ns


def _read_calibration(date: Path) -> tuple[KittiCalibration, tuple[int, int]]:
    """The calibration of a date, and the size of camera 2's pictures. Raises UsageError for missing files."""
    files = [date / f"calib_{name}.txt" for name in ("cam_to_cam", "velo_to_cam", "imu_to_velo")]
    for file in files:
        if not file.is_file():
            raise UsageError(f"{file} is missing; {_CALIBRATION_FIX}")
    cam, velo, imu = (CalibrationFile(file, read_keyed_numbers(file), _CALIBRATION_FIX) for file in files)
    keys = {camera: f"P_rect_{camera:02d}" for camera in CAMERAS}
    projections = cam.projections(keys, LABELLED_CAMERA)
    width_px, height_px = cam.matrix(f"S_rect_{LABELLED_CAMERA:02d}", (2,))
    rectification_R, camera_SE3_lidar = cam.rotation("R_rect_00"), _rotation_and_translation(velo)
    velo.refuse_camera_aside("R", rectification_R @ camera_SE3_lidar[:3, :3])
    calibration = KittiCalibration(
        projections, rectification_R, camera_SE3_lidar, _rotation_and_translation(imu)
    )
    return calibration, (int(width_px), int(height_px))


def _rotation_and_translation(calibration: CalibrationFile) -> Float64:
    return se3(calibration.rotation("R"), calibration.matrix("T", (3,)))
