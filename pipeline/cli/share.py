"""The command that makes a data set ready to publish."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, typed
from advpipe.pipeline.core.progress import with_progress
from advpipe.pipeline.core.text import counted


@with_progress("sharing {dataset}")
def share_command(
    dataset: Annotated[Path, typer.Argument(help="Data set folder.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder to make, or NAME.tar, or s3://BUCKET/FOLDER.",
            show_default="shared/<name>",
        ),
    ] = None,
    split_mb: Annotated[
        int | None, typer.Option("--split-mb", help="Parts of an archive: NAME.tar.000 and so on.", min=1)
    ] = None,
    sign: Annotated[
        Path | None,
        typer.Option("--sign", help="Sign with this Ed25519 private key in PEM (needs the extra `sign`)."),
    ] = None,
    licence: Annotated[
        str | None, typer.Option("--licence", help="SPDX identifier, such as CC-BY-4.0.")
    ] = None,
    citation: Annotated[
        str | None, typer.Option("--citation", help="How to cite it: a text, or a file such as a .bib.")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Make a data set ready to publish, as a folder or an archive; the data set itself is not touched.

    Card, pictures, layouts for Foxglove and RViz, contracts for checkers, checksums, provenance, signature.
    """
    from advpipe.pipeline.core.errors import as_usage_error
    from advpipe.pipeline.core.remote_path import RemotePath
    from advpipe.pipeline.core.verbosity import notice
    from advpipe.pipeline.process.folder import working_path
    from advpipe.stages.share.options import citation_text
    from advpipe.stages.share.run import ShareOptions
    from advpipe.stages.share.run import share as run

    size_bytes = None if split_mb is None else split_mb * 1_000_000
    with as_usage_error():
        options = ShareOptions(licence, citation_text(citation), sign, size_bytes, overwrite)
    summary = run(dataset, out or working_path("shared") / dataset.resolve().name, options)
    for warning in summary.warnings:
        notice(f"note: {warning}")

    def show() -> None:
        for path in summary.made:
            print(path)
        print(f"{counted(summary.files, 'file')}, {summary.bytes / 1e6:.1f} MB")

    then = "inspect" if isinstance(summary.made[0], RemotePath) else "verify"
    return Answer(vars(summary), show, next_commands=[typed(then, summary.made[0])])
