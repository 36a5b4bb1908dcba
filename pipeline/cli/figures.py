"""The command that gives the figures of a report for a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.completion import figure_formats
from advpipe.pipeline.cli.shared import Answer, Overwrite, typed
from advpipe.pipeline.core.progress import with_progress


@with_progress("copying the figures of {report}")
def figures_command(
    report: Annotated[Path, typer.Argument(help="Folder of a report, or its report.html.")],
    format: Annotated[
        str, typer.Option("--format", help="pdf, svg or png.", autocompletion=figure_formats)
    ] = "pdf",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder to write.", show_default="<report>-<format>")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Write the figures of a report as PDF, SVG or PNG, for a paper."""
    from advpipe.stages.evaluate.report.figures import export_figures

    folder = report.parent if report.is_file() else report
    resolved = folder.resolve()
    target = out or resolved.with_name(f"{resolved.name}-{format}")
    written = export_figures(report, format, target, overwrite)

    def show() -> None:
        for path in written:
            print(path)

    return Answer(
        {"folder": target, "figures": list(written)},
        show,
        made={"folder": target},
        next_commands=[_what_next(folder, format)],
    )


def _what_next(report: Path, done: str) -> str:
    """To publish the data set that the report is of; elsewhere, the same figures in another format."""
    from advpipe.pipeline.dataset.layout import is_dataset
    from advpipe.stages.evaluate.report.figures import FORMATS

    dataset = report.resolve().parent.parent
    if is_dataset(dataset):
        here = Path.cwd()
        return typed("share", dataset.relative_to(here) if dataset.is_relative_to(here) else dataset)
    return typed("figures", report, "--format", next(one for one in FORMATS if one != done))
