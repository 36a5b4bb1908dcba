"""The command that prints the JSON Schema of scenario files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, line


def schema(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write.", show_default="standard output")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """The JSON Schema of scenario files, for editors and checkers.

    Editors with a YAML language server complete and check a scenario that starts with the line
    `# yaml-language-server: $schema=FILE`.
    """
    from advpipe.pipeline.scenario.schema import schema_json, write_schema

    if out is None:
        return Answer(json.loads(schema_json()), line(schema_json()))
    write_schema(out, overwrite)
    return Answer({"schema": out}, line(out))
