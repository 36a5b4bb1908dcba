"""The command line: the one package here that knows the stages; each is imported inside its command."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Annotated

import typer

from advpipe.pipeline.cli.attack import attack
from advpipe.pipeline.cli.bags import inspect, plot, recover
from advpipe.pipeline.cli.clean import clean
from advpipe.pipeline.cli.evaluate import evaluate
from advpipe.pipeline.cli.export import export
from advpipe.pipeline.cli.one_line_errors import OneLineErrors
from advpipe.pipeline.cli.run import run
from advpipe.pipeline.cli.schema import schema
from advpipe.pipeline.cli.share import share
from advpipe.pipeline.cli.shared import Answer, answering
from advpipe.pipeline.cli.simulate import simulate
from advpipe.pipeline.cli.sweep import sweep
from advpipe.pipeline.cli.train import import_weights, train
from advpipe.pipeline.cli.unpack import unpack
from advpipe.pipeline.cli.verify import verify

app = typer.Typer(
    cls=OneLineErrors,
    name="advpipe",
    help="Adversarial attacks on autonomous vehicles: simulate a drive, attack it, measure the damage.",
    epilog="Exit codes: 0 done; 1 findings, or a failure on the way; 2 wrong use; 128 + n ended by signal n.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

COMMANDS: dict[str, Callable[..., Answer]] = {
    "simulate": simulate,
    "attack": attack,
    "evaluate": evaluate,
    "sweep": sweep,
    "export": export,
    "run": run,
    "train": train,
    "import-weights": import_weights,
    "share": share,
    "unpack": unpack,
    "inspect": inspect,
    "plot": plot,
    "recover": recover,
    "clean": clean,
    "verify": verify,
    "schema": schema,
}
for word, command in COMMANDS.items():
    app.command(word)(answering(command))


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"advpipe {version('advpipe')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    traceback: Annotated[
        bool,
        typer.Option("--traceback", help="Show where an unexpected error came from; or ADVPIPE_TRACEBACK=1."),
    ] = False,
) -> None:
    if traceback:
        from advpipe.pipeline.process.last_resort import SHOW

        os.environ[SHOW] = "1"
