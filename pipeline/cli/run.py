"""The command that goes through all stages."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.attack import attacked
from advpipe.pipeline.cli.completion import scenario_names
from advpipe.pipeline.cli.evaluate import evaluated
from advpipe.pipeline.cli.shared import (
    Answer,
    Cluster,
    DetectorName,
    Device,
    Level,
    LidarHeight,
    Overwrite,
    ScaleIntensity,
    Workers,
    cli_option,
    print_line,
    show_part,
    typed,
)
from advpipe.pipeline.cli.simulate import simulated
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.progress import with_progress, working_on

if TYPE_CHECKING:
    from advpipe.pipeline.campaigns.run import Part


@with_progress("running {scenario}")
def run(
    scenario: Annotated[
        str, typer.Argument(help="A scenario file or a shipped name.", autocompletion=scenario_names)
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Data set folder.", show_default="datasets/<name>")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Override one key: section.key=value.")
    ] = None,
    detector: DetectorName = "small",
    device: Device = "cpu",
    workers: Workers = None,
    cluster: Cluster = None,
    lidar_height_m: LidarHeight = None,
    level: Level = False,
    scale_intensity: ScaleIntensity = 1.0,
    debug: Annotated[bool, cli_option(AttackOptions, "debug", "--debug/--no-debug")] = AttackOptions.debug,
    overwrite: Overwrite = False,
) -> Answer:
    """All stages: simulate a scenario, carry out its attacks, evaluate; goes on where it was stopped.

    What is done already is kept. A drive, bag or report in its place that comes of anything else is
    refused, or replaced with --overwrite.
    """
    from advpipe.pipeline.core.errors import as_usage_error
    from advpipe.pipeline.process.folder import refuse_undecodable, working_path
    from advpipe.pipeline.scenario import load_scenario

    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.run import Campaign, mistakes_of_attacks
        from advpipe.pipeline.cluster.connect import use_cluster
        from advpipe.pipeline.detector.adaptation import Adaptation

    with as_usage_error():
        loaded = load_scenario(scenario, settings or (), mistakes_of_attacks)
        folder = out or working_path("datasets") / loaded.name
        campaign = Campaign.of(
            loaded,
            folder,
            detector,
            device,
            debug=debug,
            adaptation=Adaptation(lidar_height_m, level, scale_intensity),
            workers=workers,
            overwrite=overwrite,
        )
    refuse_undecodable(folder)
    with use_cluster(cluster, device):
        drive, *attacks, scored = (show_part(_answer(part)) for part in campaign.run())
    document = {"data_set": folder, "drive": drive, "attacks": attacks, "evaluation": scored}
    report = Path(scored["report"])
    figures = typed("figures", report.parent if report.suffix else report)
    return Answer(document, lambda: None, next_commands=[typed("view", folder), figures])


def _answer(part: Part) -> Answer:
    from advpipe.pipeline.campaigns.run import Evaluated, Kept
    from advpipe.stages.attack.run import AttackSummary

    if isinstance(part, Kept):
        return Answer({part.kind: part.path, "kept": True}, print_line(f"{part.path}: kept"))
    if isinstance(part, Evaluated):
        return evaluated(part.report)
    return attacked(part) if isinstance(part, AttackSummary) else simulated(part)
