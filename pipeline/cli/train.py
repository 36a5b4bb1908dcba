"""The commands that make detectors: `train_command` and `import-weights`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.completion import family_names, preset_names
from advpipe.pipeline.cli.shared import Answer, Cluster, Device, Overwrite, cli_option, print_line, typed
from advpipe.pipeline.core.progress import with_progress
from advpipe.stages.train.options import USUAL_STEPS, TrainOptions


@with_progress("training a detector on {bags}")
def train_command(
    bags: Annotated[list[Path], typer.Argument(help="Clean bags to learn from.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the checkpoint, log and plot.")],
    family: Annotated[
        str, cli_option(TrainOptions, "family", autocompletion=family_names)
    ] = TrainOptions.family,
    preset: Annotated[
        str, cli_option(TrainOptions, "preset", autocompletion=preset_names)
    ] = TrainOptions.preset,
    steps: Annotated[int, cli_option(TrainOptions, "steps")] = USUAL_STEPS,
    batch_size: Annotated[int, cli_option(TrainOptions, "batch_size")] = TrainOptions.batch_size,
    start: Annotated[Path | None, cli_option(TrainOptions, "start", "--start")] = None,
    learning_rate: Annotated[float, cli_option(TrainOptions, "learning_rate")] = TrainOptions.learning_rate,
    validate: Annotated[Path | None, cli_option(TrainOptions, "validation", "--validate")] = None,
    bf16: Annotated[bool, cli_option(TrainOptions, "bf16", "--bf16")] = False,
    device: Device = TrainOptions.device,
    seed: Annotated[int, cli_option(TrainOptions, "seed")] = TrainOptions.seed,
    cluster: Cluster = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Train a detector on clean bags; goes on where an interrupted run stopped.

    With --cluster, other machines read the bags; one process learns.
    """
    from advpipe.commands.train import train as run
    from advpipe.pipeline.core.errors import UsageError

    if not 0 < learning_rate < math.inf:
        raise UsageError(f"--learning-rate is {learning_rate:g}; it must be finite and above 0")
    summary = run(
        *bags,
        out=out,
        family=family,
        preset=preset,
        steps=steps,
        batch_size=batch_size,
        start=start,
        learning_rate=learning_rate,
        validate=validate,
        bf16=bf16,
        device=device,
        seed=seed,
        cluster=cluster,
        overwrite=overwrite,
    )
    return Answer(
        vars(summary),
        print_line(str(summary).removeprefix(f"{summary.checkpoint}: ")),
        made={"checkpoint": summary.checkpoint},
        next_commands=[typed("evaluate", validate or bags[0], "--detector", summary.checkpoint)],
    )


@with_progress("importing {file}")
def import_weights(
    file: Annotated[Path, typer.Argument(help="Checkpoint (.pth) of OpenPCDet.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The .safetensors file to write.")],
    family: Annotated[
        str, cli_option(TrainOptions, "family", autocompletion=family_names)
    ] = TrainOptions.family,
    overwrite: Overwrite = False,
) -> Answer:
    """Turn a network that OpenPCDet trained into a detector for --detector; runs no code from the file.

    Family second takes second.yaml and pointpillars takes pointpillar.yaml, both of KITTI; centerpoint takes
    centerpoint_without_resnet.yaml of Waymo.
    """
    from advpipe.pipeline.core.errors import OutputExistsError, UsageError
    from advpipe.pipeline.detector.checkpoint import save_checkpoint
    from advpipe.pipeline.detector.families import family_named

    if out.suffix != ".safetensors":
        raise UsageError(f"--out is {out}; a detector's file must end in .safetensors")
    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    net, provenance = family_named(family).import_weights(file)
    save_checkpoint(net, out, provenance, half=False, overwrite=overwrite)
    parameters = sum(weight.numel() for weight in net.parameters())
    return Answer(
        {"checkpoint": out, "preset": net.preset.name, "parameters": parameters},
        print_line(f"preset {net.preset.name}, {parameters:,} parameters"),
        made={"checkpoint": out},
        next_commands=[typed("evaluate", "--detector", out)],
    )
