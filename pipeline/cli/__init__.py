"""The command line: the one package here that knows the stages; each is imported inside its command."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Annotated

import typer

from advpipe.pipeline.cli.attack import attack_command
from advpipe.pipeline.cli.attack_parameters import AttackCommand
from advpipe.pipeline.cli.attacks import attacks_command
from advpipe.pipeline.cli.audit import audit_command
from advpipe.pipeline.cli.bags import inspect, plot, recover_command
from advpipe.pipeline.cli.check import check_command
from advpipe.pipeline.cli.clean import clean
from advpipe.pipeline.cli.demo import demo
from advpipe.pipeline.cli.evaluate import evaluate_command
from advpipe.pipeline.cli.export import export
from advpipe.pipeline.cli.figures import figures_command
from advpipe.pipeline.cli.grid import grid_command
from advpipe.pipeline.cli.import_ import import_command
from advpipe.pipeline.cli.investigate import investigate_command
from advpipe.pipeline.cli.one_line_errors import OneLineErrors
from advpipe.pipeline.cli.play import play_command
from advpipe.pipeline.cli.relay import relay_command
from advpipe.pipeline.cli.run import run
from advpipe.pipeline.cli.schema import schema_command
from advpipe.pipeline.cli.share import share_command
from advpipe.pipeline.cli.shared import Answer, answering
from advpipe.pipeline.cli.simulate import simulate_command
from advpipe.pipeline.cli.sweep import sweep_command
from advpipe.pipeline.cli.train import import_weights, train_command
from advpipe.pipeline.cli.train_camera import train_camera_command
from advpipe.pipeline.cli.unpack import unpack_command
from advpipe.pipeline.cli.verify import verify_command
from advpipe.pipeline.cli.view import view_command

app = typer.Typer(
    cls=OneLineErrors,
    name="advpipe",
    help="Adversarial attacks on autonomous vehicles: simulate a drive, attack it, measure the damage.",
    epilog="Exit codes: 0 done; 1 findings, or a failure on the way; 2 wrong use; 128 + n ended by signal n.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

COMMANDS: dict[str, Callable[..., Answer]] = {
    "demo": demo,
    "simulate": simulate_command,
    "attack": attack_command,
    "evaluate": evaluate_command,
    "figures": figures_command,
    "attacks": attacks_command,
    "sweep": sweep_command,
    "grid": grid_command,
    "import": import_command,
    "export": export,
    "run": run,
    "train": train_command,
    "train-camera": train_camera_command,
    "import-weights": import_weights,
    "share": share_command,
    "unpack": unpack_command,
    "inspect": inspect,
    "plot": plot,
    "view": view_command,
    "play": play_command,
    "relay": relay_command,
    "recover": recover_command,
    "clean": clean,
    "check": check_command,
    "verify": verify_command,
    "audit": audit_command,
    "investigate": investigate_command,
    "schema": schema_command,
}
for name, command in COMMANDS.items():
    app.command(name, cls=AttackCommand if name == "attack" else None)(answering(command))


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
        from advpipe.pipeline.process.unexpected_error import SHOW

        os.environ[SHOW] = "1"
