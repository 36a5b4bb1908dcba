"""Importing a drive of another data set as a function."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike, refuse_existing
from advpipe.stages.import_.options import LOG_FORMS, ImportOptions, ImportRequest

if TYPE_CHECKING:
    from advpipe.stages.import_.beacons.run import LogSummary
    from advpipe.stages.import_.run import ImportSummary


def import_drive(
    form: str,
    source: PathLike,
    out: PathLike,
    *,
    licence: str | None = ImportOptions.licence,
    frames: str = ImportOptions.frames,
    drive: str | None = ImportOptions.drive,
    split: str | None = ImportOptions.split,
    interval_s: float | None = ImportOptions.interval_s,
    lidar_height_m: float | None = ImportOptions.lidar_height_m,
    columns: str | None = ImportOptions.columns,
    points: str | None = ImportOptions.points,
    objects: str | None = ImportOptions.objects,
    scale_intensity: float | None = ImportOptions.scale_intensity,
    classes: Mapping[str, str] | None = None,
    overwrite: bool = False,
) -> ImportSummary | LogSummary:
    """Make a data set of a drive that another data set, simulator or ROS recording holds.

    form: `kitti`, `openpcdet`, `nuscenes`, `av2`, `opv2v`, `files`, `rosbag`, or `module:Class`; `veremi`,
    `f2md` or `nextgen` for a published log of V2X messages. source: its
    folder or file. out: the data set's folder. licence: SPDX identifier, where the form does not fix it.
    frames: of the drive, `start:stop:step`. drive: one of several. split: only its frames. interval_s:
    between frames of a source without times. lidar_height_m: above the ground. columns: of a point in raw
    files, such as `x,y,z,intensity`. points, objects: topics of clouds and boxes. scale_intensity: a factor.
    classes: from the source's classes to ours, or to `ignore` or `drop`. overwrite: replaces an `out` that
    exists.

    Returns what was imported; as a path it stands for the clean bag. Raises AdvpipeError, one line, for a
    source that is not of the form, is damaged, or holds what cannot be right.

    >>> drive = advpipe.import_drive("kitti", "kitti/training", "datasets/kitti", frames="0:100")
    """
    refuse_existing(Path(out), overwrite)
    from advpipe.stages.import_.run import import_drive as run

    options = ImportOptions(
        licence=licence,
        frames=frames,
        drive=drive,
        split=split,
        interval_s=interval_s,
        lidar_height_m=lidar_height_m,
        columns=columns,
        points=points,
        objects=objects,
        scale_intensity=scale_intensity,
        classes=classes or {},
    )
    request = ImportRequest(form, Path(source), options)
    if form in LOG_FORMS:
        from advpipe.stages.import_.beacons.run import import_log

        return import_log(request, Path(out), overwrite=overwrite)
    return run(request, Path(out), overwrite=overwrite)
