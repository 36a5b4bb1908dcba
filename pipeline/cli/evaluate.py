"""The command of stage 3."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.shared import (
    Answer,
    BaselineTries,
    Device,
    LidarTopic,
    Overwrite,
    Workers,
    cli_option,
)
from advpipe.stages.evaluate.options import Options

if TYPE_CHECKING:
    from advpipe.stages.evaluate.run import Report


def evaluate_command(
    bags: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Clean bag, then adversarial ones.", show_default="newest data set, all its attacks"
        ),
    ] = None,
    detector: Annotated[
        list[str] | None,
        cli_option(Options, "detectors", "--detector", show_default="small"),
    ] = None,
    device: Device = "cpu",
    frames: Annotated[str, cli_option(Options, "frames")] = "::",
    defence: Annotated[
        list[str] | None, cli_option(Options, "defences", "--defence", show_default=False)
    ] = None,
    seed: Annotated[int, cli_option(Options, "seed")] = Options.seed,
    baseline: Annotated[bool, cli_option(Options, "baseline")] = Options.baseline,
    baseline_tries: BaselineTries = None,
    lidar: LidarTopic = None,
    write_detections: Annotated[bool, cli_option(Options, "detections", "--write-detections")] = False,
    with_clouds: Annotated[bool, cli_option(Options, "with_clouds", "--with-clouds")] = False,
    workers: Workers = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Report folder.", show_default="reports/ of the data set"),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Stage 3: run a detector on clean and adversarial bags; AP, mAP ratio, Chamfer distance, report."""
    from advpipe.pipeline.bag.frames import FrameSlice
    from advpipe.pipeline.bag.locate import adversarial_bags, newest_dataset, resolve_bag
    from advpipe.pipeline.core.errors import wrong_use
    from advpipe.pipeline.core.verbosity import detail
    from advpipe.pipeline.detector.registry import detector_slug
    from advpipe.pipeline.process.folder import here, refuse_undecodable
    from advpipe.stages.evaluate.run import evaluate as run

    with wrong_use():
        given = bags or [newest_dataset(here("datasets"))]
        clean = resolve_bag(given[0])
        adversarial = [resolve_bag(bag) for bag in given[1:]]
        chosen = FrameSlice.parse(frames)
    if len(given) == 1 and clean.name == "clean":
        adversarial = adversarial_bags(clean.parent)
    detectors = detector or ["small"]
    target = out or clean.parent / "reports" / "+".join(detector_slug(name) for name in detectors)
    refuse_undecodable(clean, *adversarial, target)
    detail(
        f"{', '.join(detectors)} on {device}, seed {seed}: {clean} and {len(adversarial)} adversarial bags"
    )
    report = run(
        clean,
        adversarial,
        target,
        Options(
            detectors=tuple(detectors),
            seed=seed,
            baseline=baseline,
            baseline_tries=baseline_tries,
            defences=tuple(defence or ()),
            frames=chosen,
            lidar_topic=lidar,
            detections=write_detections or with_clouds,
            with_clouds=with_clouds,
            device=device,
        ),
        overwrite=overwrite,
        workers=workers,
    )

    return evaluated(report, target)


def evaluated(report: Report, folder: Path) -> Answer:
    """The tables of a report, and where its page is."""
    from advpipe.stages.evaluate.run import print_report

    page = folder / "report.html"

    def show() -> None:
        print_report(report)
        print(f"report: {page}")

    return Answer({"report": page, **json.loads(report.to_json())}, show)
