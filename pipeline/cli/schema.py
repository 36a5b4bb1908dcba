"""The command that prints the JSON Schemas of scenario files, reports, grid files and files of `relay`."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, print_line, typed
from advpipe.pipeline.core.progress import with_progress


class SchemaKind(str, Enum):
    """What there is a schema of."""

    scenario = "scenario"
    report = "report"
    relay = "relay"
    grid = "grid"


@with_progress("making the schema", at_once=False)
def schema_command(
    of: Annotated[
        SchemaKind,
        typer.Option(
            "--of", help="Scenario files, grid files, files of `relay`, or the report.json of `evaluate`."
        ),
    ] = SchemaKind.scenario,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write.", show_default="standard output")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """The JSON Schema of scenario files, for editors and checkers; or that of other files.

    Editors with a YAML language server complete and check a file that starts with the line
    `# yaml-language-server: $schema=FILE`.
    """
    from advpipe.pipeline.campaigns.grid.models import grid_schema_json
    from advpipe.pipeline.campaigns.relay.settings import relay_schema_json
    from advpipe.pipeline.core.atomic_file import write_new
    from advpipe.pipeline.results.schema import report_schema_json
    from advpipe.pipeline.scenario.schema import schema_json

    makers = {
        SchemaKind.scenario: schema_json,
        SchemaKind.report: report_schema_json,
        SchemaKind.relay: relay_schema_json,
        SchemaKind.grid: grid_schema_json,
    }
    text = makers[of]()
    if out is None:
        return Answer(json.loads(text), print_line(text))
    write_new(out, f"{text}\n", overwrite)
    used = (
        typed("evaluate", "--json")
        if of is SchemaKind.report
        else f"# yaml-language-server: $schema={out}    (as the first line of a {of.value})"
    )
    return Answer({"schema": out}, lambda: None, made={"schema": out}, next_commands=[used])
