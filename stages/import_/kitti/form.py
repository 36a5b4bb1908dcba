"""KITTI's folders: which of its forms one is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.import_.drive import DriveSource
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.kitti.object_frames import ObjectFrames
from advpipe.stages.import_.kitti.odometry import OdometrySequence
from advpipe.stages.import_.kitti.raw import RawDrive, raw_drives
from advpipe.stages.import_.options import IGNORED, ImportOptions


class KittiForm(DriveForm):
    """The object benchmark, raw drives (synchronised), and the odometry benchmark, told by their folders."""

    title = "KITTI: object, raw (synchronised) and odometry"
    licence = "CC-BY-NC-SA-3.0"
    citation = (
        "A. Geiger, P. Lenz, R. Urtasun: Are we ready for Autonomous Driving? The KITTI Vision Benchmark "
        "Suite, CVPR 2012; A. Geiger, P. Lenz, C. Stiller, R. Urtasun: Vision meets Robotics: The KITTI "
        "Dataset, IJRR 2013"
    )
    takes = ("drive", "split", "interval_s", "lidar_height_m", "scale_intensity", "classes")
    classes: ClassVar[Mapping[str, str]] = {
        "Car": "car",
        "Van": IGNORED,  # KITTI's evaluation counts a van found as a car neither way
        "Truck": "truck",
        "Pedestrian": "pedestrian",
        "Person_sitting": IGNORED,
        "Cyclist": "cyclist",
        "Tram": IGNORED,
        "Misc": IGNORED,
        "DontCare": IGNORED,
    }

    def open(self, source: Path, options: ImportOptions) -> DriveSource:
        """Find out which form the folder has and open it."""
        if not source.is_dir():
            raise UsageError(
                f"{source} {'is no folder' if source.exists() else 'does not exist'}; give KITTI's folder"
            )
        found = _forms_of(source)
        if not found:
            raise UsageError(
                f"{source} is no folder of KITTI: it has neither training/velodyne (object), nor "
                "DATE/DATE_drive_NNNN_sync (raw), nor sequences/NN/velodyne (odometry)"
            )
        if len(found) > 1:
            raise UsageError(
                f"{source} mixes KITTI's forms {' and '.join(found)}; give the folder of one of them"
            )
        classes = self.class_map(options)
        if found == ["raw"]:
            return RawDrive(source, options, classes)
        if found == ["odometry"]:
            return OdometrySequence(source, options)
        return ObjectFrames(source, options, classes)


def _forms_of(source: Path) -> list[str]:
    has_calib_file, has_calib_folder = (source / "calib.txt").is_file(), (source / "calib").is_dir()
    is_sequence = has_calib_file or (source / "times.txt").is_file()
    has_clouds = (source / "velodyne").is_dir()
    is_object = any((source / name).is_dir() for name in ("training", "testing"))
    found = {
        "object": is_object
        or (has_clouds and (has_calib_folder or not is_sequence))
        or (source / "label_2").is_dir(),
        "raw": bool(raw_drives(source)),
        "odometry": (source / "sequences").is_dir() or (has_clouds and is_sequence),
    }
    return [form for form, is_there in found.items() if is_there]
