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


DEFAULT = "district"
_DEFAULTS = [DEFAULT]


@with_progress("simulating {scenarios}")
def simulate_command(
    scenarios: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO",
            help="Scenario files or shipped names.",
            autocompletion=scenario_names,
            show_default=DEFAULT,
        ),
    ] = _DEFAULTS,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Data set folder; of several, where they lie.", show_default="datasets/<name>"
        ),
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
    """Stage 1: record a clean drive (LiDARs, cameras, radars, V2X, GNSS, ground truth) to an MCAP bag.

    Of several scenarios, data sets NAME in the folder --out; with --seeds, NAME-seedN for each seed. Those
    that are there are kept, and a run that was interrupted goes on.
    """
    if seeds is not None or len(scenarios) > 1:
        if live is not None:
            from advpipe.pipeline.core.errors import UsageError

            raise UsageError("--live publishes one drive; give one scenario and no --seeds")
        return _simulated_drives(scenarios, settings or (), seeds, out, workers, cluster, overwrite)
    from advpipe.commands.simulate import simulate as run

    return simulated(run(scenarios[0], settings=settings or (), out=out, live=live, overwrite=overwrite))


def _simulated_drives(
    names: Sequence[str],
    settings: Sequence[str],
    seeds: str | None,
    out: Path | None,
    workers: int | None,
    cluster: str | None,
    overwrite: bool,
) -> Answer:
    """The drives of several scenarios or seeds."""
    from advpipe.commands.paths import DATA_SETS
    from advpipe.pipeline.core.errors import as_usage_error
    from advpipe.pipeline.core.remote_path import refuse_remote
    from advpipe.pipeline.process.folder import refuse_undecodable, working_path
    from advpipe.pipeline.scenario import load_scenario

    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.drives import planned_drives, simulate_drives
        from advpipe.pipeline.campaigns.seeds import parse_seeds
        from advpipe.pipeline.cluster.connect import use_cluster
    with as_usage_error():
        chosen = None if seeds is None else parse_seeds(seeds)
        loaded = [load_scenario(name, settings) for name in names]
        base = out or working_path(DATA_SETS)
        is_one = out is not None and len(loaded) == 1
        planned = planned_drives(loaded, chosen, lambda one: base if is_one else base / one.name)
    refuse_remote(base, "name a folder of this machine with --out")
    refuse_undecodable(base)
    with use_cluster(cluster):
        drives = simulate_drives(planned, overwrite=overwrite, workers=workers)
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
