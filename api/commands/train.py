"""The training of a detector as a function."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike
from advpipe.commands.training_bags import training_bags
from advpipe.pipeline.core.errors import as_usage_error, writing
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.pipeline.core.verbosity import detail
from advpipe.stages.train.options import USUAL_STEPS, TrainOptions

if TYPE_CHECKING:
    from advpipe.stages.train.run import TrainSummary


@with_progress("training a detector on {bags}")
def train(
    *bags: PathLike,
    out: PathLike,
    family: str = TrainOptions.family,
    preset: str = TrainOptions.preset,
    steps: int = USUAL_STEPS,
    batch_size: int = TrainOptions.batch_size,
    start: PathLike | None = None,
    learning_rate: float = TrainOptions.learning_rate,
    validate: PathLike | None = None,
    bf16: bool = TrainOptions.bf16,
    device: str = TrainOptions.device,
    seed: int = TrainOptions.seed,
    cluster: str | None = None,
    overwrite: bool = False,
) -> TrainSummary:
    """Train a detector on clean bags; goes on where an interrupted run stopped.

    bags: to learn from. out: the folder of checkpoint, log and plot. family, preset: architecture and size of
    the detector. steps: of the optimiser. batch_size: frames of a step; some 16 on a GPU. start: a checkpoint
    of the same preset to go on from. learning_rate: its peak, after the warm-up. validate: a held-out bag to
    score. bf16: half the time where the processor has it. device: where it computes. seed: of weights, order
    and augmentation. cluster: the address of a Ray cluster that reads the bags, or `auto`; one process
    learns.

    Returns what the run made, with 3D AP R40 in percent by class if there was a bag to validate on. Raises
    UsageError for bags without ground truth and for options that are out of range.

    >>> trained = advpipe.train("datasets/a", "datasets/b", out="runs/mine", validate="datasets/c")
    >>> advpipe.evaluate(drive, detector=str(trained.checkpoint))
    """
    learned, held_out = training_bags(bags, validate, out)
    with working_on("loading libraries"):
        from advpipe.pipeline.cluster.connect import use_cluster
        from advpipe.stages.train.config import TrainConfig
        from advpipe.stages.train.run import train as run
    with as_usage_error():
        config = TrainConfig(
            bags=learned,
            out=Path(out),
            family=family,
            preset=preset,
            start=None if start is None else Path(start),
            steps=steps,
            batch_size=batch_size,
            learning_rate=learning_rate,
            validation=held_out,
            bf16=bf16,
            device=device,
            seed=seed,
        )
    detail(f"preset {preset}, {steps} steps on {len(learned)} bags, seed {seed}, on {device}")
    with writing(out):
        return run(config, overwrite=overwrite, while_reading=partial(use_cluster, cluster))
