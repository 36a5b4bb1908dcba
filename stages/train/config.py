"""The configuration of a training run."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.preset import Preset
from advpipe.pipeline.detector.families import family_named
from advpipe.pipeline.geometry.boxes import CLASSES, MIN_POINTS
from advpipe.stages.train.options import TrainOptions

MOST_SEED = 2**63 - 1
"""The largest seed of PyTorch's generators."""


@dataclass(frozen=True)
class Augmentation:
    """How each training frame is augmented; `Augmentation.none()` leaves it as recorded.

    yaw_rad, scale, shift_voxels: largest change either way. drop: largest share of points dropped.
    jitter_m: largest standard deviation of noise. intensity: largest relative change.
    paste: how many objects of each class (car, truck, cyclist, pedestrian) from other frames.
    remounted: share of frames whose sensor is raised or lowered by up to height_m and tilted by up to
    tilt_rad, on ground that rises or falls by up to slope_rad (see `mounting`); the others keep their ground.
    """

    yaw_rad: float = 3.141592653589793
    flip: bool = True
    scale: float = 0.05
    # Sub-voxel shifts keep the detector from learning the positions of voxel faces.
    shift_voxels: float = 0.5
    drop: float = 0.2
    jitter_m: float = 0.02
    intensity: float = 0.3
    paste: tuple[int, int, int, int] = (5, 4, 8, 10)
    remounted: float = 0.6
    height_m: float = 0.45
    tilt_rad: float = 0.052
    slope_rad: float = 0.06

    @classmethod
    def none(cls) -> Augmentation:
        """No augmentation at all."""
        return cls(0.0, False, 0.0, 0.0, 0.0, 0.0, 0.0, (0, 0, 0, 0), 0.0)


@dataclass(frozen=True)
class TrainConfig(TrainOptions):
    """One training run.

    bags: clean bags (dataset folders, rosbag2 folders or .mcap files). out: the run's folder.
    epochs: passes over the frames; steps, when given, overrides it. checkpoint_every: steps.
    workers: processes, by default one per core; the result does not depend on it. device: see `open_device`;
    a GPU is used by one process alone.
    validation: a bag of another drive, for the average precision; at the end on all of its frames that
    validation_frames names, and every `validate_every` steps on about 40 of them, equally spaced.
    """

    bags: tuple[Path, ...]
    out: Path
    epochs: float = 8.0
    weight_decay: float = 0.01
    warmup: float = 0.05
    clip_norm: float = 10.0
    workers: int | None = None
    min_points: int = MIN_POINTS
    checkpoint_every: int = 200
    validation_frames: str = "::1"
    validate_every: int = 1000
    augmentation: Augmentation = Augmentation()

    @property
    def network_preset(self) -> Preset:
        """The preset that `family` and `preset` name; raises UsageError for unknown names."""
        return family_named(self.family).preset(self.preset)

    def __post_init__(self) -> None:
        if self.network_preset.classes != CLASSES:
            raise AdvpipeError(
                f"preset {self.preset} has other classes than advpipe's drives; use it with imported "
                "weights (advpipe import-weights), as it cannot be trained here"
            )
        if not self.bags:
            raise AdvpipeError("train needs at least one bag")
        for name in ("batch_size", "checkpoint_every", "epochs", "learning_rate"):
            if not getattr(self, name) > 0:
                raise AdvpipeError(f"{name} is {getattr(self, name)}; it has to be above 0")
        if not isfinite(self.learning_rate):
            raise AdvpipeError(f"learning_rate is {self.learning_rate}; it has to be finite")
        if not 0 <= self.seed <= MOST_SEED:
            raise AdvpipeError(f"seed is {self.seed:.6g}; it has to be in 0 to 2^63 - 1")
        if self.steps is not None and self.steps < 1:
            raise AdvpipeError(f"steps is {self.steps}; it has to be at least 1")
        if not 0 <= self.warmup < 1:
            raise AdvpipeError(f"warmup is {self.warmup}; it is a share of the steps, in [0, 1)")
