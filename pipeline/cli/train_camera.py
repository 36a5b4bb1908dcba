"""The command `train-camera`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Device, Overwrite, cli_option, print_line, typed
from advpipe.pipeline.core.progress import with_progress
from advpipe.stages.train.camera.options import ImageTrainOptions


@with_progress("training an image detector on {bags}")
def train_camera_command(
    bags: Annotated[list[Path], typer.Argument(help="Clean bags with cameras, to learn from.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the checkpoint, log and plot.")],
    steps: Annotated[int, cli_option(ImageTrainOptions, "steps")] = ImageTrainOptions.steps,
    batch_size: Annotated[int, cli_option(ImageTrainOptions, "batch_size")] = ImageTrainOptions.batch_size,
    start: Annotated[Path | None, cli_option(ImageTrainOptions, "start", "--start")] = None,
    learning_rate: Annotated[
        float, cli_option(ImageTrainOptions, "learning_rate")
    ] = ImageTrainOptions.learning_rate,
    validate: Annotated[Path | None, cli_option(ImageTrainOptions, "validation", "--validate")] = None,
    bf16: Annotated[bool, cli_option(ImageTrainOptions, "bf16", "--bf16")] = False,
    device: Device = ImageTrainOptions.device,
    seed: Annotated[int, cli_option(ImageTrainOptions, "seed")] = ImageTrainOptions.seed,
    overwrite: Overwrite = False,
) -> Answer:
    """Train an image detector on the pictures of clean bags; goes on where an interrupted run stopped."""
    from advpipe.commands.train_camera import train_camera as run
    from advpipe.pipeline.core.errors import UsageError

    if not 0 < learning_rate < math.inf:
        raise UsageError(f"--learning-rate is {learning_rate:g}; it must be finite and above 0")
    summary = run(
        *bags,
        out=out,
        steps=steps,
        batch_size=batch_size,
        start=start,
        learning_rate=learning_rate,
        validate=validate,
        bf16=bf16,
        device=device,
        seed=seed,
        overwrite=overwrite,
    )
    return Answer(
        {**vars(summary), "precision": summary.to_dicts()},
        print_line(str(summary).removeprefix(f"{summary.checkpoint}: ")),
        made={"checkpoint": summary.checkpoint},
        next_commands=[typed("evaluate", validate or bags[0], "--image-detector", summary.checkpoint)],
    )
