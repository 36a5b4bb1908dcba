"""Train an image detector on the pictures of recorded drives."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path

import torch
from torch import Tensor

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core import signals
from advpipe.pipeline.core.progress import plan_progress, track, working_on
from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted
from advpipe.pipeline.detector.device import device_record, open_device
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.detector.training_maps import KEY, listed_maps, map_of
from advpipe.pipeline.image_detector.checkpoint import load_image_checkpoint, save_image_checkpoint
from advpipe.pipeline.image_detector.loss import LOSS_PARTS, losses
from advpipe.pipeline.image_detector.network import PRESETS, ImageNet
from advpipe.pipeline.image_detector.network_detector import NetworkImageDetector
from advpipe.pipeline.image_detector.registry import image_detector_sha256
from advpipe.pipeline.image_detector.scoring import PicturePrecision
from advpipe.stages.train.camera.config import ImageTrainConfig
from advpipe.stages.train.camera.examples import Batch, ImageExamples
from advpipe.stages.train.camera.pictures import PictureStore, labelled_cameras
from advpipe.stages.train.camera.validate import PictureDrive, moderate_percents
from advpipe.stages.train.folder import RunFolder
from advpipe.stages.train.learning_rate import learning_rate
from advpipe.stages.train.log import VALIDATIONS, Log, plot_training, step_columns
from advpipe.stages.train.state import TrainState

READING = "reading the pictures"
SOME_PICTURES = 60
"""Number of pictures of a validation during the run."""


@dataclass(frozen=True, repr=False)
class ImageTrainSummary(Tabular):
    """The results of a run: the checkpoint, the logs, and the detector's average precision."""

    checkpoint: Path
    log: Path
    picture: Path
    steps: int
    pictures: int
    precision: tuple[PicturePrecision, ...]
    """By class and difficulty on the validation bag; empty without one."""

    def __str__(self) -> str:
        """The checkpoint, its training data, and the average precision at moderate difficulty."""
        found = ", ".join(
            f"{name} {percent:.1f} %"
            for name, percent in moderate_percents(self.precision).items()
            if isfinite(percent)
        )
        about = f"{self.checkpoint}: {counted(self.steps, 'step')} on {counted(self.pictures, 'picture')}"
        return about + (f"; moderate 2D AP on the held-out bag: {found}" if found else "")

    def to_dicts(self) -> Rows:
        """A row for each class and difficulty of the validation bag, AP R40 as shares; none without a bag."""
        return [asdict(each) for each in self.precision]


def train_camera(config: ImageTrainConfig, *, overwrite: bool = False) -> ImageTrainSummary:
    """Train an image detector on the pictures of the bags, or resume an unfinished run.

    The checkpoint does not depend on interruptions of the run. Raises AdvpipeError for bags without labelled
    pictures, a folder in use, and a loss that is not finite.
    """
    plan_progress({READING: 5, "train": 90, "validate": 5})
    folder, device = RunFolder(config.out), open_device(config.device)
    bags = [resolve_bag(bag) for bag in config.bags]
    for bag in (*bags, *((config.validation,) if config.validation else ())):
        labelled_cameras(resolve_bag(bag))
    torch.manual_seed(config.seed)
    net = _new_net(config).to(device)
    with folder.locked(overwrite), fixed_torch_threads(config.threads):
        with working_on(READING):
            digests = {bag: parent_sha256(bag) for bag in bags}
            origin = {
                "bags_sha256": json.dumps(list(digests.values())),
                "start": image_detector_sha256(str(config.start)) if config.start else "",
            }
            folder.open(asdict(config), origin, overwrite)
            store = PictureStore.build(digests, folder.frames)
        return _train(folder, net, store, config, origin | {KEY: _maps(bags, config.start)})


def _new_net(config: ImageTrainConfig) -> ImageNet:
    net = ImageNet(PRESETS[config.preset])
    if config.start is not None:
        net.load_state_dict(load_image_checkpoint(config.start).net.state_dict())
    channels_last: ImageNet = net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return channels_last


def _train(
    folder: RunFolder, net: ImageNet, store: PictureStore, config: ImageTrainConfig, origin: dict[str, str]
) -> ImageTrainSummary:
    """Run the remaining steps and the last validation, and write the files of a finished run."""
    examples, steps = ImageExamples(store, config), config.steps
    drive = PictureDrive(resolve_bag(config.validation)) if config.validation else None
    provenance = origin | _settings(config, len(store))
    state = TrainState.new(net, config.learning_rate, config.weight_decay)
    if folder.state.is_file():
        state.restore(folder.state)

    def saved(steps_done: int) -> NetworkImageDetector:
        """The detector as loaded from its file, with weights in half precision."""
        state.require_finite()
        about = {**provenance, "steps": f"{steps_done} of {steps}"}
        save_image_checkpoint(net, folder.latest, about, overwrite=True)
        return load_image_checkpoint(folder.latest)

    recent: list[float] = []
    with (
        closing(Log(folder.log, step_columns(LOSS_PARTS), state.step)) as log,
        closing(Log(folder.validations, VALIDATIONS, min(state.step, steps - 1))) as validations,
        signals.deferred() as stopped,  # a step is not interrupted, so that the state can be saved
    ):
        for step in track(range(state.step, steps), "train", steps - state.step, lambda: _status(recent)):
            rate = learning_rate(step, steps, config.learning_rate, config.warmup)
            parts, norm = train_step(state, net, examples.batch(step), rate, config)
            log.add(step, rate, sum(parts), *parts, norm)
            recent[:] = [*recent[-49:], sum(parts)]
            if drive is not None and state.step % config.validate_every == 0 and state.step < steps:
                some = drive.precision(saved(state.step), at_most=SOME_PICTURES)
                validations.add(step, *moderate_percents(some).values())
            if state.step % config.checkpoint_every == 0 or stopped.is_set():
                state.save(folder.state)
            stopped.raise_if_set()
        state.save(folder.state)
        trained = saved(steps)
        precision = drive.precision(trained) if drive else ()
        if precision:
            validations.add(steps - 1, *moderate_percents(precision).values())
    plot_training(folder.log, folder.validations, folder.picture, "moderate 2D AP in %")
    about = {**provenance, "validation": json.dumps([asdict(each) for each in precision])}
    save_image_checkpoint(trained.net, folder.checkpoint, about, overwrite=True)
    folder.tidy()
    return ImageTrainSummary(folder.checkpoint, folder.log, folder.picture, steps, len(store), precision)


def train_step(
    state: TrainState, net: ImageNet, batch: Batch, rate: float, config: ImageTrainConfig
) -> tuple[list[float], float]:
    """Take one step of the optimiser; return the losses before it and the gradient's norm before clipping."""
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    net.train()
    device = next(net.parameters()).device
    with torch.autocast(device.type, torch.bfloat16, enabled=config.bf16):
        cells = net(batch.images.to(device))
    parts: Tensor = losses(cells, *(each.to(device) for each in (batch.heat, batch.boxes_px, batch.weights)))
    state.optimiser.zero_grad(set_to_none=True)
    parts.sum().backward()  # type: ignore[no-untyped-call]
    norm = float(torch.nn.utils.clip_grad_norm_(net.parameters(), config.clip_norm))
    found: list[float] = parts.tolist()
    if not isfinite(sum(found)) or not isfinite(norm):
        raise state.diverged()
    state.optimiser.step()
    state.step += 1
    return found, norm


def _status(recent: Sequence[float]) -> str:
    return f"loss {sum(recent) / len(recent):.3f}" if recent else "no step yet"


def _settings(config: ImageTrainConfig, pictures: int) -> dict[str, str]:
    """How the network was trained, for its checkpoint."""
    names = ("steps", "batch_size", "learning_rate", "weight_decay", "bf16", "seed", "threads")
    return {
        "pictures": str(pictures),
        **{name: str(getattr(config, name)) for name in names},
        "augmentation": json.dumps(asdict(config.augmentation)),
        "torch": torch.__version__,
        **device_record(config.device),
    }


def _maps(bags: Sequence[Path], start: Path | None) -> str:
    """The value of `training_maps.KEY`: a JSON list of the maps of the bags and of the start's."""
    maps = {map_of(BagReader(bag).provenance) for bag in bags}
    if start is not None:
        known = listed_maps(load_image_checkpoint(start).provenance.get(KEY))
        maps |= {None} if known is None else set(known)
    named = sorted(each for each in maps if each is not None)
    return json.dumps([*named, *([None] if None in maps else [])])
