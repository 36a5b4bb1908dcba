"""The command of stage 1."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite

if TYPE_CHECKING:
    from advpipe.stages.simulate.run import SimulationSummary


def simulate_command(
    scenario: Annotated[str, typer.Argument(help="A scenario file or a shipped name.")] = "district",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Data set folder.", show_default="datasets/<name>")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Override one key: section.key=value.")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Stage 1: record a clean drive (LiDAR, ground truth, odometry, GNSS) to an MCAP bag."""
    from advpipe.pipeline.core.errors import wrong_use
    from advpipe.pipeline.core.verbosity import detail
    from advpipe.pipeline.process.folder import here
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.stages.simulate.run import simulate as run

    with wrong_use():
        loaded = load_scenario(scenario, settings or ())
    detail(f"scenario {loaded.name} of {scenario}, seed {loaded.simulation.seed}")
    folder = out or here("datasets") / loaded.name
    return simulated(run(loaded, folder, overwrite=overwrite), folder)


def simulated(summary: SimulationSummary, folder: Path) -> Answer:
    """The bag of a drive, and what is in it."""

    def show() -> None:
        print(
            f"{summary.bag}: {summary.frames} frames, "
            f"{summary.clouds} clouds of {summary.points / max(summary.clouds, 1):,.0f} points, "
            f"{summary.road_users} road users in range"
        )
        for name, value in summary.v2x.lines() if summary.v2x else ():
            print(f"{name}: {value}")

    return Answer({"data_set": folder, **vars(summary)}, show)
