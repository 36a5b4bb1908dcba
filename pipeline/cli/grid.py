"""The command that runs a grid of experiments."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Cluster, Device, Workers
from advpipe.pipeline.core.progress import with_progress


@with_progress("running the grid {file}")
def grid_command(
    file: Annotated[Path, typer.Argument(help="Grid file; `advpipe schema --of grid` describes it.")],
    device: Device = "cpu",
    keep_bags: Annotated[bool, typer.Option("--keep-bags", help="Keep the adversarial bags.")] = False,
    workers: Workers = None,
    cluster: Cluster = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder.", show_default="grids/<name>")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Compute cells that other code of advpipe made again.")
    ] = False,
) -> Answer:
    """Run scenario keys x seeds x attacks x detectors x defences; goes on where it was stopped.

    Each finished cell is kept in cells/ of the output, and only those that are missing are run. The output
    has all figures in grid.parquet, and report.html shows them with intervals over drives.
    """
    from advpipe.commands.grid import grid

    report = grid(
        file,
        device=device,
        keep_bags=keep_bags,
        workers=workers,
        cluster=cluster,
        out=out,
        overwrite=overwrite,
    )
    document = {"report": report.page, "table": report.table, "rows": report.to_dicts()}
    return Answer(document, report.show, made={"report": report.page, "table": report.table})
