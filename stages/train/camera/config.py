"""The configuration of a run that trains an image detector."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.options import check_bounds
from advpipe.stages.train.camera.options import ImageTrainOptions


@dataclass(frozen=True)
class ImageAugmentation:
    """How a picture is changed before it is learned from.

    size_px: width and height of the section that is learned from. scale: least and most enlargement. focused:
    share of sections that are laid around an object, rare classes and large ones more often; the others lie
    anywhere.
    flip: whether half of them are mirrored. light, colour, contrast: largest relative change.
    """

    size_px: tuple[int, int] = (384, 224)
    scale: tuple[float, float] = (0.55, 1.6)
    focused: float = 0.7
    flip: bool = True
    light: float = 0.35
    colour: float = 0.1
    contrast: float = 0.25


@dataclass(frozen=True)
class ImageTrainConfig(ImageTrainOptions):
    """One training run.

    bags: clean bags with labelled pictures. out: the run's folder. checkpoint_every: steps. threads: of
    PyTorch, on which the last bits of the weights depend. least_height_px, least_share: lower objects, and
    those of which less is visible, are not learned. validate_every: steps, on about 60 pictures.
    """

    bags: tuple[Path, ...]
    out: Path
    preset: str = "small"
    weight_decay: float = 0.02
    warmup: float = 0.05
    clip_norm: float = 10.0
    threads: int = 1
    checkpoint_every: int = 200
    validate_every: int = 1000
    least_height_px: float = 8.0
    least_share: float = 0.25
    augmentation: ImageAugmentation = ImageAugmentation()

    def __post_init__(self) -> None:
        if not self.bags:
            raise AdvpipeError("train-camera needs at least one bag")
        check_bounds(self)
        if not (isfinite(self.learning_rate) and self.learning_rate > 0):
            raise AdvpipeError(f"learning_rate is {self.learning_rate}; it has to be finite and above 0")
