"""The command that makes a data set of a drive in another form."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.completion import form_names
from advpipe.pipeline.cli.shared import Answer, Overwrite, cli_option, print_line, typed
from advpipe.pipeline.core.progress import with_progress
from advpipe.stages.import_.options import FORM_NAMES, ImportOptions


@with_progress("importing {source} as {form}")
def import_command(
    form: Annotated[
        str,
        typer.Argument(help=f"{', '.join(FORM_NAMES)}, or module:Class.", autocompletion=form_names),
    ],
    source: Annotated[Path, typer.Argument(help="The source's folder or file.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Data set folder to make.")],
    licence: Annotated[
        str | None, cli_option(ImportOptions, "licence", show_default="the form's")
    ] = ImportOptions.licence,
    frames: Annotated[str, cli_option(ImportOptions, "frames")] = ImportOptions.frames,
    drive: Annotated[str | None, cli_option(ImportOptions, "drive")] = ImportOptions.drive,
    split: Annotated[str | None, cli_option(ImportOptions, "split")] = ImportOptions.split,
    interval_s: Annotated[
        float | None, cli_option(ImportOptions, "interval_s", "--interval")
    ] = ImportOptions.interval_s,
    lidar_height_m: Annotated[
        float | None, cli_option(ImportOptions, "lidar_height_m", "--lidar-height")
    ] = ImportOptions.lidar_height_m,
    columns: Annotated[str | None, cli_option(ImportOptions, "columns")] = ImportOptions.columns,
    points: Annotated[str | None, cli_option(ImportOptions, "points")] = ImportOptions.points,
    objects: Annotated[str | None, cli_option(ImportOptions, "objects")] = ImportOptions.objects,
    scale_intensity: Annotated[
        float | None, cli_option(ImportOptions, "scale_intensity")
    ] = ImportOptions.scale_intensity,
    classes: Annotated[list[str] | None, cli_option(ImportOptions, "classes", "--class")] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Make a data set of a drive that another data set, simulator or ROS recording holds.

    The data set is like one of `simulate`: attack it, evaluate, export and share it.
    """
    from advpipe.commands.import_drive import import_drive
    from advpipe.pipeline.core.errors import UsageError

    mapping: dict[str, str] = {}
    for pair in classes or []:
        name, equals, ours = pair.partition("=")
        if not equals:
            raise UsageError(f"--class {pair}: write NAME=CLASS, such as Van=truck")
        if mapping.setdefault(name, ours) != ours:
            raise UsageError(f"--class {pair}: {name} is already {mapping[name]}; give each class once")
    summary = import_drive(
        form,
        source,
        out,
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
        classes=mapping,
        overwrite=overwrite,
    )
    folder = summary.data_set
    return Answer(
        {"data_set": folder, **summary.to_dicts()[0], "notes": list(summary.notes)},
        print_line(str(summary).removeprefix(f"{summary.bag}: ")),
        made={"bag": summary.bag},
        next_commands=[typed("evaluate", folder), typed("view", folder)],
    )
