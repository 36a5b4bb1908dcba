"""The command of stage 1."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.completion import scenario_names, words_of
from advpipe.pipeline.cli.shared import Answer, Overwrite, print_line, typed
from advpipe.pipeline.core.progress import with_progress
from advpipe.pipeline.live import PUBLISHERS

if TYPE_CHECKING:
    from advpipe.stages.simulate.run import SimulationSummary


@with_progress("simulating {scenario}")
def simulate_command(
    scenario: Annotated[
        str, typer.Argument(help="A scenario file or a shipped name.", autocompletion=scenario_names)
    ] = "district",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Data set folder.", show_default="datasets/<name>")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Override one key: section.key=value.")
    ] = None,
    live: Annotated[
        str | None,
        typer.Option(
            help=f"Also publish the drive as it is recorded, at most in real time: {', '.join(PUBLISHERS)}.",
            autocompletion=words_of(PUBLISHERS),
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Stage 1: record a clean drive (LiDAR, ground truth, odometry, GNSS) to an MCAP bag."""
    from advpipe.commands.simulate import simulate as run

    return simulated(run(scenario, settings=settings or (), out=out, live=live, overwrite=overwrite))


def simulated(summary: SimulationSummary) -> Answer:
    """The bag of a drive, and what is in it."""
    folder = summary.data_set
    attacks = [typed("attack", folder, "--type", "detach")] if summary.clouds else [typed("attacks")]
    return Answer(
        {"data_set": folder, **vars(summary)},
        print_line(str(summary).removeprefix(f"{summary.bag}: ")),
        made={"bag": summary.bag},
        next_commands=[*attacks, typed("view", folder)],
    )
