"""The command that prints the JSON Schema of scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Overwrite


def schema(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write.", show_default="standard output")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """The JSON Schema of scenario files, for editors and checkers.

    Editors with a YAML language server complete and check a scenario that starts with the line
    `# yaml-language-server: $schema=FILE`.
    """
    from advpipe.pipeline.scenario.schema import schema_json, write_schema

    if out is None:
        print(schema_json())
    else:
        write_schema(out, overwrite)
        print(out)
