"""The command that unpacks a data set that others shared."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, typed
from advpipe.pipeline.core.progress import with_progress


@with_progress("unpacking {archive}")
def unpack_command(
    archive: Annotated[Path, typer.Argument(help="NAME.tar, or any part of it such as NAME.tar.000.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder to make.", show_default="NAME beside the archive"),
    ] = None,
) -> Answer:
    """Unpack an archive of `advpipe share`, safely: a damaged, truncated or hostile one leaves no files.

    Every byte is checked; `advpipe verify` then checks what the data set claims.
    """
    from advpipe.pipeline.dataset.archive import unpack_archive as run

    folder = run(archive, out)
    return Answer(
        {"folder": folder},
        lambda: None,
        made={"data set": folder},
        next_commands=[typed("verify", folder)],
    )
