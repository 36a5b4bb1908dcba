"""The command that attacks and evaluates at every budget of a table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.campaigns.sweep.options import SweepOptions
from advpipe.pipeline.cli.completion import (
    attack_check_names,
    defence_names,
    sweep_recipes,
    words_of,
)
from advpipe.pipeline.cli.shared import (
    Answer,
    BaselineTries,
    Cluster,
    DetectorName,
    Device,
    Level,
    LidarHeight,
    LidarTopic,
    Overwrite,
    ScaleIntensity,
    Workers,
    cli_option,
    typed,
)
from advpipe.pipeline.core.progress import with_progress


@with_progress("sweeping {bag}")
def sweep_command(
    bag: Annotated[
        Path | None, typer.Argument(help="Clean bag or its data set.", show_default="newest data set")
    ] = None,
    table: Annotated[
        str, cli_option(SweepOptions, "table", autocompletion=words_of((SweepOptions.table,)))
    ] = SweepOptions.table,
    recipes: Annotated[
        str, cli_option(SweepOptions, "recipes", "--recipes", "--recipe", autocompletion=sweep_recipes)
    ] = "best",
    cells: Annotated[
        list[str] | None,
        cli_option(SweepOptions, "cells", "--cells", show_default="all"),
    ] = None,
    frames: Annotated[
        str | None,
        cli_option(SweepOptions, "frames", show_default="at most 100, equally spaced over the bag"),
    ] = None,
    detector: DetectorName = "small",
    device: Device = "cpu",
    seed: Annotated[int, cli_option(SweepOptions, "seed")] = SweepOptions.seed,
    seeds: Annotated[int, cli_option(SweepOptions, "seeds")] = SweepOptions.seeds,
    baseline_tries: BaselineTries = None,
    defences: Annotated[
        list[str] | None,
        cli_option(SweepOptions, "defences", "--defence", show_default="none", autocompletion=defence_names),
    ] = None,
    detect_attacks: Annotated[
        list[str] | None,
        cli_option(
            SweepOptions,
            "detect_attacks",
            "--detect-attacks",
            show_default="none",
            autocompletion=attack_check_names,
        ),
    ] = None,
    lidar: LidarTopic = None,
    lidar_height_m: LidarHeight = None,
    level: Level = False,
    scale_intensity: ScaleIntensity = SweepOptions.scale_intensity,
    keep_bags: Annotated[bool, cli_option(SweepOptions, "keep_bags", "--keep-bags")] = False,
    check: Annotated[
        int | None,
        typer.Option(min=1, help="Only compute so many finished cells again, drawn by --seed, and compare."),
    ] = None,
    workers: Workers = None,
    cluster: Cluster = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder.", show_default="reports/sweep-<detector> of the data set"),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Attack and evaluate at every budget of the paper's tables; goes on where it was stopped.

    Each finished cell is kept in cells/ of the output, and only those that are missing are run. Other
    recipes, with frames of their own, may be added to the same output later.
    """
    from advpipe.commands.sweep import prepared
    from advpipe.pipeline.cluster.connect import use_cluster

    asked = prepared(
        bag,
        out,
        table=table,
        recipes=recipes,
        cells=cells or (),
        frames=frames,
        detector=detector,
        device=device,
        seed=seed,
        seeds=seeds,
        baseline_tries=baseline_tries,
        defences=tuple(defences or SweepOptions.defences),
        detect_attacks=tuple(detect_attacks or SweepOptions.detect_attacks),
        lidar_topic=lidar,
        lidar_height_m=lidar_height_m,
        level=level,
        scale_intensity=scale_intensity,
        keep_bags=keep_bags,
        workers=workers,
    )
    with use_cluster(cluster, device):
        if check is not None:
            return Answer({"checked": asked.check(check)}, lambda: None)
        report = asked.run(overwrite)
    page, figures = report.folder / "report.html", report.folder / "report.json"
    document = json.loads(figures.read_text(encoding="utf-8"))

    return Answer(
        {"report": page, **document},
        report.show,
        made={"report": page},
        next_commands=[typed("figures", report.folder, "--format", "png")],
    )
