"""Options of a training run that the command line offers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core import options
from advpipe.pipeline.core.options import option

USUAL_STEPS = 3000
"""The command line's default, which has no option for epochs."""


@dataclass(frozen=True, kw_only=True)
class TrainOptions:
    """The network to train, and how to train it.

    family, preset: see `detector.families`. steps: None for the number of epochs in `TrainConfig`.
    start: a checkpoint of the same preset, or of another family with most of its layers, whose weights the
    run starts from. validation: a bag of another drive, for the average precision.
    """

    family: str = option("second", "Architecture of the detector.")
    preset: str = option("small", "Size of the detector.")
    steps: int | None = option(None, "Optimiser steps.", least=1)
    batch_size: int = option(2, "Frames of a step; some 16 on a GPU.", least=1)
    start: Path | None = option(None, "Begin with the weights of this checkpoint.")
    learning_rate: float = option(3e-3, "Peak rate, after the warm-up.")
    validation: Path | None = option(None, "A held-out bag to score.")
    bf16: bool = option(False, "Half the time where the processor has it.")
    device: str = options.device()
    seed: int = option(0, "Seed of weights, order and augmentation.", least=0)
