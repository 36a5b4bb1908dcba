"""Argoverse 2's form of sensor logs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.stages.import_.av2.log import AXLE_HEIGHT_M, Av2Log
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.named_files import chosen_drive
from advpipe.stages.import_.options import ImportOptions

POSES = "city_SE3_egovehicle.feather"
"""The file by which a log is recognised."""


class Av2Form(DriveForm):
    """Logs of the Argoverse 2 Sensor Dataset, each a folder of Feather files.

    Cycles, which stand or lie beside the boxes of their riders, trailers, animals, and objects that are no
    road users count neither way.
    """

    title = "Argoverse 2: sensor logs"
    licence = "CC-BY-NC-SA-4.0"
    citation = (
        "Wilson et al., Argoverse 2: Next Generation Datasets for Self-Driving Perception, NeurIPS 2021"
    )
    takes = ("drive", "lidar_height_m", "scale_intensity", "classes")
    classes: ClassVar[Mapping[str, str]] = {
        "REGULAR_VEHICLE": "car",
        "LARGE_VEHICLE": "truck",
        "BOX_TRUCK": "truck",
        "TRUCK": "truck",
        "TRUCK_CAB": "truck",
        "BUS": "truck",
        "SCHOOL_BUS": "truck",
        "ARTICULATED_BUS": "truck",
        "BICYCLIST": "cyclist",
        "MOTORCYCLIST": "cyclist",
        "PEDESTRIAN": "pedestrian",
        "OFFICIAL_SIGNALER": "pedestrian",
    }

    def open(self, source: Path, options: ImportOptions) -> Av2Log:
        """Open a log, or one of a folder's logs. Raises UsageError for missing files."""
        height_m = AXLE_HEIGHT_M if options.lidar_height_m is None else options.lidar_height_m
        return Av2Log(
            _log_folder(source, options.drive), self.class_map(options), height_m, options.scale_intensity
        )


def _log_folder(source: Path, drive: str | None) -> Path:
    if not source.is_dir():
        raise UsageError(f"{source} is not a folder; give a log of Argoverse 2, or a folder of logs")
    if (source / POSES).is_file():
        if drive not in (None, source.resolve().name):
            raise UsageError(
                f"{source} is one log; leave out {option_name('drive')}, or give the folder of logs"
            )
        return source
    logs = {file.parent.name: file.parent for file in sorted(source.glob(f"*/{POSES}"))}
    if not logs:
        raise UsageError(
            f"{source} is no sensor log of Argoverse 2 and holds none (no {POSES}); give the folder of a "
            "log, or the one of a split, such as sensor/val"
        )
    return logs[chosen_drive(source, "log", list(logs), drive)]
