"""The training of an image detector as a function."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike
from advpipe.commands.training_bags import training_bags
from advpipe.pipeline.core.errors import as_usage_error, writing
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.stages.train.camera.options import ImageTrainOptions

if TYPE_CHECKING:
    from advpipe.stages.train.camera.run import ImageTrainSummary


@with_progress("training an image detector on {bags}")
def train_camera(
    *bags: PathLike,
    out: PathLike,
    steps: int = ImageTrainOptions.steps,
    batch_size: int = ImageTrainOptions.batch_size,
    start: PathLike | None = None,
    learning_rate: float = ImageTrainOptions.learning_rate,
    validate: PathLike | None = None,
    bf16: bool = ImageTrainOptions.bf16,
    device: str = ImageTrainOptions.device,
    seed: int = ImageTrainOptions.seed,
    overwrite: bool = False,
) -> ImageTrainSummary:
    """Train an image detector on the pictures of clean bags; goes on where an interrupted run stopped.

    bags: with cameras, to learn from. out: the folder of checkpoint, log and plot. steps: of the optimiser.
    batch_size: pictures of a step. start: a checkpoint to go on from. learning_rate: its peak, after the
    warm-up. validate: a held-out bag to score. bf16: half the time where the processor has it. device: where
    it computes. seed: of weights, order and augmentation.

    Returns what the run made, with 2D AP R40 as a share by class and difficulty if there was a bag to
    validate on. Raises UsageError for bags without labelled pictures and for options that are out of range.

    >>> trained = advpipe.train_camera("datasets/a", "datasets/b", out="runs/eye", validate="datasets/c")
    >>> advpipe.evaluate(drive, image_detector=str(trained.checkpoint))
    """
    learned, held_out = training_bags(bags, validate, out)
    with working_on("loading libraries"):
        from advpipe.stages.train.camera.config import ImageTrainConfig
        from advpipe.stages.train.camera.run import train_camera as run
    with as_usage_error():
        config = ImageTrainConfig(
            bags=learned,
            out=Path(out),
            start=None if start is None else Path(start),
            steps=steps,
            batch_size=batch_size,
            learning_rate=learning_rate,
            validation=held_out,
            bf16=bf16,
            device=device,
            seed=seed,
        )
    with writing(out):
        return run(config, overwrite=overwrite)
