"""The command of stage 1."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.completion import scenario_names, words_of
from advpipe.pipeline.cli.shared import Answer, Cluster, Overwrite, Workers, print_line, typed
from advpipe.pipeline.core.progress import with_progress, working_on
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
    seeds: Annotated[
        str | None,
        typer.Option(help="Record a drive for each of these seeds, such as 1-20,25.", show_default=False),
    ] = None,
    workers: Workers = None,
    cluster: Cluster = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Stage 1: record a clean drive (LiDAR, ground truth, odometry, GNSS) to an MCAP bag.

    With --seeds, one drive for each: data sets NAME-seedN, of which those that are there are kept.
    """
    if seeds is not None:
        return _simulated_seeds(scenario, settings or (), seeds, out, live, workers, cluster, overwrite)
    from advpipe.commands.simulate import simulate as run

    return simulated(run(scenario, settings=settings or (), out=out, live=live, overwrite=overwrite))


def _simulated_seeds(
    scenario: str,
    settings: Sequence[str],
    seeds: str,
    out: Path | None,
    live: str | None,
    workers: int | None,
    cluster: str | None,
    overwrite: bool,
) -> Answer:
    """The drives of several seeds; a live one has a single seed."""
    from advpipe.commands.paths import DATA_SETS
    from advpipe.pipeline.core.errors import UsageError, as_usage_error
    from advpipe.pipeline.process.folder import refuse_undecodable, working_path
    from advpipe.pipeline.scenario import load_scenario

    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.seeds import parse_seeds, simulate_seeds
        from advpipe.pipeline.cluster.connect import use_cluster
    with as_usage_error():
        chosen = parse_seeds(seeds)
        if live is not None:
            raise UsageError("--live publishes one drive; leave --seeds out")
        loaded = load_scenario(scenario, settings)
    base = out or working_path(DATA_SETS) / loaded.name
    refuse_undecodable(base)
    with use_cluster(cluster):
        drives = simulate_seeds(loaded, chosen, base, overwrite=overwrite, workers=workers)
    documents = [
        {"data_set": drive.folder, "seed": drive.seed, "kept": not drive.summary} for drive in drives
    ]
    lines = [f"{drive.summary or f'{drive.folder}: kept'}" for drive in drives]
    return Answer({"drives": documents}, print_line("\n".join(lines)))


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
