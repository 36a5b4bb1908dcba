"""The options of an import; a form refuses those that mean nothing to it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.licence import check_licence
from advpipe.pipeline.core.lidar_height import check_lidar_height
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.options import check_bounds, option

LOG_FORMS = ("veremi", "f2md", "nextgen")
"""Logs of beacons: VeReMi (2018), VeReMi Extension as F2MD writes it, and VeReMi NextGen."""

FORM_NAMES = ("kitti", "openpcdet", "nuscenes", "av2", "opv2v", "files", "rosbag", *LOG_FORMS)
"""The keys of `registry.FORMS`, where a command line need not load the forms, and logs."""

IGNORED = "ignore"
"""In place of a class: boxes that count neither way."""

DROPPED = "drop"
"""In place of a class: no box at all."""


@dataclass(frozen=True)
class ImportOptions:
    """The options of `advpipe import`; `form_options` are those that only some forms take."""

    licence: str | None = option(
        None, "Licence of the source, an SPDX identifier such as CC-BY-NC-SA-4.0; it stands on the card."
    )
    frames: str = option("::", "Frames of the drive to import, start:stop:step.")
    drive: str | None = option(None, "Which drive (scene, log, sequence) of a source that has several.")
    split: str | None = option(None, "Only the frames that the source lists for a split, such as val.")
    interval_s: float | None = option(
        None, "Time between frames in seconds, where the source has no times.", least=0
    )
    lidar_height_m: float | None = option(
        None, "Height of the LiDAR above the ground in metres, where the source does not know it."
    )
    columns: str | None = option(
        None, "Columns of each point in a .bin or .npy file, such as x,y,z,intensity,ring; _ skips one."
    )
    points: str | None = option(None, "Topic of the point clouds, where a recording has several.")
    objects: str | None = option(None, "Topic of the true boxes, where a recording has several.")
    scale_intensity: float | None = option(
        None, "Factor on intensities, such as 0.00392157 (1/255) for a scale of 0 to 255.", least=0
    )
    classes: Mapping[str, str] = field(
        default_factory=dict,
        metadata={
            "help": "A class of the source as one of ours, NAME=CLASS: car, truck, cyclist, pedestrian, "
            f"{IGNORED} (counts neither way) or {DROPPED}; repeatable.",
            "least": None,
        },
    )

    def __post_init__(self) -> None:
        from advpipe.pipeline.geometry.boxes import CLASSES  # numpy is for when an import runs

        check_bounds(self)
        for number in (each.name for each in fields(self) if isinstance(getattr(self, each.name), float)):
            if not math.isfinite(getattr(self, number)):
                raise UsageError(f"{option_name(number)} is not a finite number")
        check_lidar_height(self.lidar_height_m)
        if self.licence is not None:
            check_licence(self.licence)
        if self.scale_intensity == 0:
            raise UsageError(f"{option_name('scale_intensity')} is 0, which leaves no intensity; give more")
        for name, ours in self.classes.items():
            if not name:
                raise UsageError(f"class ={ours}: the class of the source is missing; write NAME={ours}")
            if ours not in (*CLASSES, IGNORED, DROPPED):
                raise UsageError(
                    f"class {name}={ours}: {ours!r} is none of {', '.join((*CLASSES, IGNORED, DROPPED))}"
                )

    def refuse_others(self, form: str, taken: tuple[str, ...]) -> None:
        """Raise UsageError for an option that is set although the form does not take it."""
        default = ImportOptions()
        for each in fields(self):
            if each.name in _OF_ALL or each.name in taken:
                continue
            if getattr(self, each.name) != getattr(default, each.name):
                raise UsageError(f"{option_name(each.name)} means nothing to the form {form}; leave it out")


_OF_ALL = ("licence", "frames")


@dataclass(frozen=True)
class ImportRequest:
    """What is imported from where: the form's name, the source's folder or file, and the options."""

    form: str
    source: Path
    options: ImportOptions
