"""The commands that make detectors: `train_command` and `import-weights`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Device, Overwrite, cli_option, print_line
from advpipe.stages.train.options import USUAL_STEPS, TrainOptions

if TYPE_CHECKING:
    from advpipe.stages.train.run import TrainSummary


def train_command(
    bags: Annotated[list[Path], typer.Argument(help="Clean bags to learn from.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the checkpoint, log and plot.")],
    family: Annotated[str, cli_option(TrainOptions, "family")] = TrainOptions.family,
    preset: Annotated[str, cli_option(TrainOptions, "preset")] = TrainOptions.preset,
    steps: Annotated[int, cli_option(TrainOptions, "steps")] = USUAL_STEPS,
    start: Annotated[Path | None, cli_option(TrainOptions, "start", "--start")] = None,
    learning_rate: Annotated[float, cli_option(TrainOptions, "learning_rate")] = TrainOptions.learning_rate,
    validate: Annotated[Path | None, cli_option(TrainOptions, "validation", "--validate")] = None,
    bf16: Annotated[bool, cli_option(TrainOptions, "bf16", "--bf16")] = False,
    device: Device = TrainOptions.device,
    seed: Annotated[int, cli_option(TrainOptions, "seed")] = TrainOptions.seed,
    overwrite: Overwrite = False,
) -> Answer:
    """Train a detector on clean bags; goes on where an interrupted run stopped."""
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.core.errors import UsageError, writing, wrong_use
    from advpipe.pipeline.core.verbosity import detail
    from advpipe.pipeline.process.folder import refuse_undecodable
    from advpipe.stages.train.config import TrainConfig
    from advpipe.stages.train.run import train as run

    if not 0 < learning_rate < math.inf:
        raise UsageError(f"--learning-rate is {learning_rate:g}; it has to be finite and above 0")
    with wrong_use():
        learned, held_out = tuple(map(resolve_bag, bags)), resolve_bag(validate) if validate else None
    if held_out and held_out.resolve() in {bag.resolve() for bag in learned}:
        raise UsageError(f"--validate {validate} is a bag to learn from; name one that is held out")
    refuse_undecodable(*learned, held_out, out)
    with wrong_use():
        config = TrainConfig(
            bags=learned,
            out=out,
            family=family,
            preset=preset,
            start=start,
            steps=steps,
            learning_rate=learning_rate,
            validation=held_out,
            bf16=bf16,
            device=device,
            seed=seed,
        )
    detail(f"preset {preset}, {steps} steps on {len(learned)} bags, seed {seed}, on {device}")
    with writing(out):
        summary = run(config, overwrite=overwrite)
    return Answer(vars(summary), print_line(_trained(summary)))


def _trained(summary: TrainSummary) -> str:
    """The checkpoint, what it learnt from, and the average precision of the classes validated."""
    found = ", ".join(
        f"{name} {precision.strict_percent:.1f} %"
        for name, precision in summary.precision.items()
        if precision.boxes
    )
    return f"{summary.checkpoint}: {summary.steps} steps on {summary.frames} frames" + (
        f"; 3D AP on the held-out bag: {found}" if found else ""
    )


def import_weights(
    file: Annotated[Path, typer.Argument(help="Checkpoint (.pth) of OpenPCDet's SECOND for KITTI.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The .safetensors file to write.")],
    family: Annotated[str, cli_option(TrainOptions, "family")] = TrainOptions.family,
    overwrite: Overwrite = False,
) -> Answer:
    """Turn a SECOND that OpenPCDet trained into a detector for --detector; runs no code from the file."""
    from advpipe.pipeline.core.errors import OutputExistsError, UsageError
    from advpipe.pipeline.detector.checkpoint import save_checkpoint
    from advpipe.pipeline.detector.families import family_named

    if out.suffix != ".safetensors":
        raise UsageError(f"--out is {out}; a detector's file is named .safetensors")
    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    net, provenance = family_named(family).import_weights(file)
    save_checkpoint(net, out, provenance, half=False, overwrite=overwrite)
    parameters = sum(weight.numel() for weight in net.parameters())
    return Answer(
        {"checkpoint": out, "preset": net.preset.name, "parameters": parameters},
        print_line(f"{out}: preset {net.preset.name}, {parameters:,} parameters; use it as --detector {out}"),
    )
