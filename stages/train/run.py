"""Train a detector on recorded drives."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path

import torch

from advpipe.pipeline.bag.frames import FrameSlice, count_frames, has_ground_truth
from advpipe.pipeline.bag.ground_truth import BOX_TYPES
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.local_processes import usable_cores
from advpipe.pipeline.core.progress import plan_progress, track, working_on
from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.detector.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from advpipe.pipeline.detector.common.network import DetectionNetwork
from advpipe.pipeline.detector.device import device_record, open_device
from advpipe.pipeline.detector.families import family_named
from advpipe.pipeline.detector.registry import detector_sha256
from advpipe.pipeline.detector.training_maps import KEY
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.examples import Examples
from advpipe.stages.train.folder import RunFolder
from advpipe.stages.train.frames import FrameStore
from advpipe.stages.train.learning_rate import learning_rate
from advpipe.stages.train.log import VALIDATIONS, Log, plot_training, step_columns
from advpipe.stages.train.maps import training_maps
from advpipe.stages.train.mounts import expected_height, mounts_of_frames
from advpipe.stages.train.reading import cropped_frames
from advpipe.stages.train.start import start_from
from advpipe.stages.train.state import TrainState
from advpipe.stages.train.status import Status
from advpipe.stages.train.validate import ClassPrecision, ValidationDrive, strict_percents
from advpipe.stages.train.workers import Gradients, gradients

READING = "reading the bags"

STORED = "with mounts"
"""What frames are stored with: a run of an earlier release stores them again."""

SOME_FRAMES = 40
"""Number of frames of a validation during the run."""


@dataclass(frozen=True, repr=False)
class TrainSummary(Tabular):
    """The results of a run: the checkpoint, the logs, and the detector's average precision."""

    checkpoint: Path
    log: Path
    picture: Path
    steps: int
    frames: int
    precision: dict[str, ClassPrecision]
    """Average precision by class on the validation bag; empty without one."""

    def __str__(self) -> str:
        """The checkpoint, its training data, and the average precision of the validated classes."""
        found = ", ".join(
            f"{name} {precision.strict_percent:.1f} %"
            for name, precision in self.precision.items()
            if precision.boxes
        )
        return f"{self.checkpoint}: {counted(self.steps, 'step')} on {counted(self.frames, 'frame')}" + (
            f"; 3D AP on the held-out bag: {found}" if found else ""
        )

    def to_dicts(self) -> Rows:
        """A row for each class of the validation bag: its boxes, and 3D AP R40 in percent; none without a
        bag."""
        return [{"class": name, **asdict(precision)} for name, precision in self.precision.items()]


def train(
    config: TrainConfig,
    *,
    overwrite: bool = False,
    while_reading: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> TrainSummary:
    """Train a detector on the frames of the bags, or resume an unfinished run with this configuration.

    The files of the run's folder: `RunFolder`. The checkpoint does not depend on interruptions of the run,
    nor on the number of worker processes. while_reading: within it, the bags are read; learning is done here,
    by one process and its helpers. Raises AdvpipeError for bags without ground truth, a folder in use,
    and a loss that is not finite.
    """
    plan_progress({READING: 5, "train": 90, "validate": 5})
    folder, device = RunFolder(config.out), open_device(config.device)
    bags = [labelled_bag(bag) for bag in config.bags]
    drive = validation_drive(config)
    torch.manual_seed(config.seed)
    net = new_net(config).to(device)
    with folder.locked(overwrite):
        with working_on(READING):
            digests = {bag: parent_sha256(bag) for bag in bags}
            origin = training_origin(config, digests)
            folder.open(asdict(config), origin, overwrite)
            with while_reading():
                store = store_frames(digests, folder, config)
        return _train(folder, net, store, config, drive, origin)


def _train(
    folder: RunFolder,
    net: DetectionNetwork,
    store: FrameStore,
    config: TrainConfig,
    drive: ValidationDrive | None,
    origin: dict[str, str],
) -> TrainSummary:
    """Run the remaining steps and the last validation, and write the files of a finished run."""
    examples = Examples(store, config)
    steps = config.steps or max(1, round(config.epochs * len(store) / config.batch_size))
    workers = config.workers or usable_cores()
    bags = [labelled_bag(bag) for bag in config.bags]
    about_bags = {
        KEY: training_maps(bags, config.start),
        **expected_height(config.network_preset.expected_input),
    }
    provenance = training_provenance(config, origin, len(store), steps) | about_bags

    state = TrainState.new(net, config.learning_rate, config.weight_decay)
    if folder.state.is_file():
        state.restore(folder.state)

    def saved(steps_done: int) -> Checkpoint:
        """The network as loaded from its file, with weights in half precision."""
        state.require_finite()
        save_checkpoint(
            net, folder.latest, {**provenance, "steps": f"{steps_done} of {steps}"}, overwrite=True
        )
        return load_checkpoint(folder.latest, net.device)

    status = Status(net.LOSS_PARTS)
    with (
        closing(Log(folder.log, step_columns(net.LOSS_PARTS), state.step)) as log,
        # A run that was killed during its last validation repeats it.
        closing(Log(folder.validations, VALIDATIONS, min(state.step, steps - 1))) as validations,
        signals.deferred() as stopped,  # a step is not interrupted, so that the state can be saved
        gradients(net, examples, workers) as gradients_of,
    ):
        for step in track(range(state.step, steps), "train", steps - state.step, status.text):
            rate = learning_rate(step, steps, config.learning_rate, config.warmup)
            parts, norm = train_step(state, gradients_of, rate, config.clip_norm)
            log.add(step, rate, sum(parts), *parts, norm)
            status.step(parts)
            if drive is not None and state.step % config.validate_every == 0 and state.step < steps:
                status.precision = drive.precision(saved(state.step).detector(), at_most=SOME_FRAMES)
                validations.add(step, *strict_percents(status.precision))
            if state.step % config.checkpoint_every == 0 or stopped.is_set():
                state.save(folder.state)
                saved(state.step)
            stopped.raise_if_set()
        state.save(folder.state)
        trained = saved(steps)
        precision = drive.precision(trained.detector()) if drive else {}
        if precision:
            validations.add(steps - 1, *strict_percents(precision))
    plot_training(folder.log, folder.validations, folder.picture)
    about = {**provenance, "validation": json.dumps({k: asdict(v) for k, v in precision.items()})}
    save_checkpoint(trained.net, folder.checkpoint, about, overwrite=True)
    folder.tidy()
    return TrainSummary(folder.checkpoint, folder.log, folder.picture, steps, len(store), precision)


def labelled_bag(path: Path) -> Path:
    """The bag that a path names. Raises UsageError for a bag without ground truth."""
    bag = resolve_bag(path)
    if not has_ground_truth(bag):
        raise UsageError(f"{bag} contains no ground truth ({' or '.join(BOX_TYPES)}) to train on")
    return bag


def new_net(config: TrainConfig) -> DetectionNetwork:
    """The network before the first step: random weights, or those of the checkpoint to start from."""
    net = family_named(config.family).network(config.preset)
    if config.start is not None:
        start_from(net, config.start)
    channels_last: DetectionNetwork = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return channels_last


def store_frames(digests: dict[Path, str], folder: RunFolder, config: TrainConfig) -> FrameStore:
    """The frames of the bags, decoded once, within the radius that a rotated range can reach."""
    r = config.network_preset.range_m
    radius_m = 1.1 * max(abs(r.x_min_m), r.x_max_m) * 2**0.5

    frames = cropped_frames(tuple(digests), radius_m)
    mounts = mounts_of_frames(digests, config.network_preset.expected_input)
    return FrameStore.build(frames, folder.frames, [*digests.values(), radius_m, STORED], mounts)


def validation_drive(config: TrainConfig) -> ValidationDrive | None:
    """The drive to validate on; raises UsageError for an invalid choice of frames."""
    if config.validation is None:
        return None
    bag, chosen = labelled_bag(config.validation), FrameSlice.parse(config.validation_frames)
    return ValidationDrive(bag, chosen.indices(count_frames(bag)), config.min_points)


def training_origin(config: TrainConfig, digests: dict[Path, str]) -> dict[str, str]:
    """Checksums of a run's training data: its bags, and the checkpoint that it starts from."""
    return {
        "bags_sha256": json.dumps(list(digests.values())),
        "start": detector_sha256(str(config.start)) if config.start else "",
    }


def training_provenance(
    config: TrainConfig, origin: dict[str, str], frames: int, steps: int
) -> dict[str, str]:
    """The provenance of the checkpoint: how it was trained."""
    return {
        **origin,
        "frames": str(frames),
        "steps": str(steps),
        "batch_size": str(config.batch_size),
        "learning_rate": str(config.learning_rate),
        "weight_decay": str(config.weight_decay),
        "bf16": str(config.bf16),
        "seed": str(config.seed),
        "augmentation": json.dumps(asdict(config.augmentation)),
        "torch": torch.__version__,
        **device_record(config.device),
    }


def train_step(
    state: TrainState, gradients_of: Gradients, rate: float, clip_norm: float
) -> tuple[list[float], float]:
    """Take one step of the optimiser; return the losses before it and the gradient's norm before clipping."""
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    parts: list[float] = gradients_of(state.step).tolist()
    norm = float(torch.nn.utils.clip_grad_norm_(state.net.parameters(), clip_norm))
    if not isfinite(sum(parts)) or not isfinite(norm):
        raise state.diverged()
    state.optimiser.step()
    state.step += 1
    return parts, norm
