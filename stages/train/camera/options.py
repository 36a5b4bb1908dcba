"""Options of the training of an image detector that the command line offers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core import options
from advpipe.pipeline.core.options import option


@dataclass(frozen=True, kw_only=True)
class ImageTrainOptions:
    """How to train. start: a checkpoint whose weights the run starts from. validation: a bag of another
    drive, for the average precision."""

    steps: int = option(6000, "Optimiser steps.", least=1)
    batch_size: int = option(8, "Pictures of a step.", least=1)
    start: Path | None = option(None, "Begin with the weights of this checkpoint.")
    learning_rate: float = option(2e-3, "Peak rate, after the warm-up.")
    validation: Path | None = option(None, "A held-out bag to score.")
    bf16: bool = option(False, "Half the time where the processor has it.")
    device: str = options.device()
    seed: int = option(0, "Seed of weights, order and augmentation.", least=0)
