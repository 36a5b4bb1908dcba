"""The command of stage 1."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Overwrite


def simulate(
    scenario: Annotated[str, typer.Argument(help="A scenario file or a shipped name.")] = "district",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Data set folder.", show_default="datasets/<name>")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Override one key: section.key=value.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Stage 1: record a clean drive (LiDAR, ground truth, odometry, GNSS) to an MCAP bag."""
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.stages.simulate.run import simulate as run

    loaded = load_scenario(scenario, settings or ())
    summary = run(loaded, out or Path("datasets") / loaded.name, overwrite=overwrite)
    print(
        f"{summary.bag}: {summary.frames} frames, "
        f"{summary.clouds} clouds of {summary.points / max(summary.clouds, 1):,.0f} points, "
        f"{summary.road_users} road users in range"
    )
    for name, value in summary.v2x.lines() if summary.v2x else ():
        print(f"{name}: {value}")
