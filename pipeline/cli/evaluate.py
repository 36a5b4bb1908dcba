"""The command of stage 3."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.completion import (
    attack_check_names,
    defence_names,
    detector_names,
    image_detector_names,
)
from advpipe.pipeline.cli.shared import (
    Answer,
    BaselineTries,
    Cluster,
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
from advpipe.stages.evaluate.options import Options

if TYPE_CHECKING:
    from advpipe.stages.evaluate.run import Report


@with_progress("evaluating {bags}")
def evaluate_command(
    bags: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Clean bag, then adversarial ones.", show_default="newest data set, all its attacks"
        ),
    ] = None,
    detector: Annotated[
        list[str] | None,
        cli_option(Options, "detectors", "--detector", show_default="small", autocompletion=detector_names),
    ] = None,
    device: Device = "cpu",
    frames: Annotated[str, cli_option(Options, "frames")] = "::",
    defence: Annotated[
        list[str] | None,
        cli_option(Options, "defences", "--defence", show_default=False, autocompletion=defence_names),
    ] = None,
    defence_frames: Annotated[
        int | None, cli_option(Options, "defence_frames", "--defence-frames", show_default=False)
    ] = None,
    detect_attacks: Annotated[
        list[str] | None,
        cli_option(
            Options,
            "detect_attacks",
            "--detect-attacks",
            show_default=", ".join(Options.detect_attacks),
            autocompletion=attack_check_names,
        ),
    ] = None,
    misbehaviour_detector: Annotated[
        list[str] | None,
        cli_option(Options, "misbehaviour_detectors", "--misbehaviour-detector", show_default=False),
    ] = None,
    image_detector: Annotated[
        str, cli_option(Options, "image_detector", autocompletion=image_detector_names)
    ] = Options.image_detector,
    seed: Annotated[int, cli_option(Options, "seed")] = Options.seed,
    baseline: Annotated[bool, cli_option(Options, "baseline")] = Options.baseline,
    baseline_tries: BaselineTries = None,
    lidar: LidarTopic = None,
    lidar_height_m: LidarHeight = None,
    level: Level = False,
    scale_intensity: ScaleIntensity = Options.scale_intensity,
    write_detections: Annotated[bool, cli_option(Options, "detections", "--write-detections")] = False,
    with_clouds: Annotated[bool, cli_option(Options, "with_clouds", "--with-clouds")] = False,
    scene: Annotated[bool, cli_option(Options, "scene")] = Options.scene,
    workers: Workers = None,
    cluster: Cluster = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Report folder.", show_default="reports/ of the data set"),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Stage 3: run a detector on clean and adversarial bags; AP, mAP ratio, Chamfer distance, report."""
    from advpipe.commands.evaluate import evaluate as run

    report = run(
        *(bags or ()),
        detector=detector or Options.detectors,
        device=device,
        frames=frames,
        defence=defence or Options.defences,
        defence_frames=defence_frames,
        detect_attacks=detect_attacks or Options.detect_attacks,
        misbehaviour_detector=misbehaviour_detector or (),
        image_detector=image_detector,
        seed=seed,
        baseline=baseline,
        baseline_tries=baseline_tries,
        lidar=lidar,
        lidar_height_m=lidar_height_m,
        level=level,
        scale_intensity=scale_intensity,
        write_detections=write_detections,
        with_clouds=with_clouds,
        scene=scene,
        workers=workers,
        cluster=cluster,
        out=out,
        overwrite=overwrite,
    )
    return evaluated(report, next_commands=_what_next(report, bags))


def _what_next(report: Report, bags: Sequence[Path] | None) -> list[str]:
    """A look at the data set in 3D, and the report's figures for a paper."""
    from advpipe.commands.paths import bag_or_newest
    from advpipe.pipeline.bag.locate import CLEAN_NAME

    clean = bag_or_newest(bags[0] if bags else None)
    return [
        typed("view", clean.parent if clean.name == CLEAN_NAME else clean),
        *([typed("figures", report.folder)] if report.folder else []),
    ]


def evaluated(report: Report, next_commands: Sequence[str] = ()) -> Answer:
    """The tables of a report, and where its page is."""
    from advpipe.stages.evaluate.run import print_report

    assert report.folder is not None  # it has been written
    page = report.folder / "report.html"

    return Answer(
        {"report": page, **json.loads(report.to_json())},
        lambda: print_report(report),
        made={"report": page},
        next_commands=next_commands,
    )
