"""The command that writes a bag in the forms of other data sets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.progress import with_progress

FORMATS = {"veremi": "extension", "veremi-2018": "2018"}
"""The forms of VeReMi by their names on the command line."""


@with_progress("exporting {bag} as {format}")
def export(
    bag: Annotated[Path, typer.Argument(help="Data set folder, bag directory or .mcap file.")],
    format: Annotated[
        str, typer.Option("--format", help=f"The form of its V2X messages: {', '.join(FORMATS)}.")
    ] = "veremi",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder to write.", show_default="<bag>-<format>")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Write a bag's V2X messages as others read them, labels included.

    veremi: JSON of the VeReMi Extension, a file a receiver and one of ground truth. veremi-2018: of VeReMi.
    """
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.core.errors import UsageError, as_usage_error
    from advpipe.stages.evaluate.v2x.veremi import export_veremi

    if format not in FORMATS:
        raise UsageError(f"unknown format {format!r}; {known_names(format, FORMATS)}")
    with as_usage_error():
        source = resolve_bag(bag)
    target = out or source.with_name(f"{source.name if source.is_dir() else source.stem}-{format}")
    written = export_veremi(source, target, form=FORMATS[format], overwrite=overwrite)

    def show() -> None:
        print(f"{written.sent} messages, {written.received} receptions of {written.receivers} vehicles")
        for attack, number in written.attacks.items():
            print(f"  attackerType {number}: {attack}")

    return Answer({"folder": target, **written._asdict()}, show, made={"folder": target})
