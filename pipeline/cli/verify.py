"""The command that checks what others shared."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, typed
from advpipe.pipeline.core.progress import with_progress
from advpipe.pipeline.core.remote_path import located


@with_progress("verifying {path}")
def verify_command(
    path: Annotated[
        Path, typer.Argument(help="Data set, rosbag2 folder, .mcap, or an archive that `share` made.")
    ],
    quick: Annotated[bool, typer.Option("--quick", help="Checksums and signature alone.")] = False,
    key: Annotated[
        Path | None, typer.Option("--key", help="The signer's public key (PEM).", show_default=False)
    ] = None,
) -> Answer:
    """Check everything that a data set or a bag claims; one line a finding, exit code 1 if there is any."""
    from advpipe.commands.verify import verify as run

    result = run(path, quick=quick, key=key)

    def show() -> None:
        for finding in result.findings:
            print(finding)
        for gap in result.unchecked:
            print(f"not checked: {gap}")
        print(result)

    next_commands = [typed("unpack" if path.suffix == ".tar" else "view", located(path))]
    return Answer(
        json.loads(result.to_json()),
        show,
        exit_code=0 if result.is_good else 1,
        next_commands=next_commands if result.is_good else (),
    )
