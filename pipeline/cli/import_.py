"""The command that makes a data set of a drive in another form."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, print_line


def import_command(
    form: Annotated[str, typer.Argument(help="The source's form; `advpipe import --forms` lists them.")],
    source: Annotated[Path, typer.Argument(help="The source's folder or file.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Data set folder to make.")],
    licence: Annotated[
        str | None, typer.Option(help="Licence of the source (SPDX), where the form does not fix it.")
    ] = None,
    frames: Annotated[str, typer.Option(help="Frames of the drive to import, start:stop:step.")] = "::",
    drive: Annotated[
        str | None, typer.Option(help="Which drive (scene, log, sequence) of a source that has several.")
    ] = None,
    split: Annotated[str | None, typer.Option(help="Only the frames of a split, such as val.")] = None,
    interval_s: Annotated[
        float | None, typer.Option("--interval", help="Seconds between frames of a source without times.")
    ] = None,
    lidar_height_m: Annotated[
        float | None, typer.Option("--lidar-height", help="Height of the LiDAR above the ground [m].")
    ] = None,
    columns: Annotated[
        str | None, typer.Option(help="Columns of a point in .bin or .npy: x,y,z,intensity,ring; _ skips.")
    ] = None,
    points: Annotated[str | None, typer.Option(help="Topic of the point clouds.")] = None,
    objects: Annotated[str | None, typer.Option(help="Topic of the true boxes.")] = None,
    scale_intensity: Annotated[
        float | None, typer.Option(help="Factor on intensities, such as 0.00392157 for 0 to 255.")
    ] = None,
    classes: Annotated[
        list[str] | None,
        typer.Option("--class", help="NAME=CLASS of the source and ours, or ignore or drop; repeatable."),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Make a data set of a drive that another data set, simulator or ROS recording holds.

    The data set is like one of `simulate`: attack it, evaluate, export and share it.
    """
    from advpipe.pipeline.core.errors import UsageError
    from advpipe.stages.import_.options import ImportOptions, ImportRequest
    from advpipe.stages.import_.run import import_drive

    mapping = {}
    for pair in classes or []:
        name, equals, ours = pair.partition("=")
        if not equals:
            raise UsageError(f"--class {pair}: write NAME=CLASS, such as Van=truck")
        mapping[name] = ours
    options = ImportOptions(
        licence, frames, drive, split, interval_s, lidar_height_m, columns, points, objects,
        scale_intensity, mapping,
    )  # fmt: skip
    summary = import_drive(ImportRequest(form, source, options), out, overwrite=overwrite)
    document = {"data_set": summary.data_set, **summary.to_dicts()[0], "notes": list(summary.notes)}
    return Answer(document, print_line(summary))
