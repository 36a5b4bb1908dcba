"""Train SECOND on recorded drives."""

from __future__ import annotations

import json
import os
import shutil
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from math import cos, pi
from pathlib import Path
from types import FrameType

import torch

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.detector.second.anchors import AnchorGrid
from advpipe.pipeline.detector.second.checkpoint import save_checkpoint
from advpipe.pipeline.detector.second.loss import Losses, losses
from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.detector.second.presets import preset_named
from advpipe.pipeline.detector.second.voxels import voxelise
from advpipe.pipeline.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.progress import track
from advpipe.stages.train.batches import Batch, Batches, load_batches
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.frames import FrameStore, LabelledCloud
from advpipe.stages.train.log import TrainLog, plot_losses
from advpipe.stages.train.state import TrainState


@dataclass(frozen=True)
class TrainSummary:
    """What a run made: the checkpoint, the log and the loss of the last step."""

    checkpoint: Path
    log: Path
    picture: Path
    steps: int
    frames: int
    loss: float
    average_precision: dict[str, float]
    """Strict 3D AP R40 in percent on the validation bag, by class; empty without one."""


def train(config: TrainConfig, *, overwrite: bool = False) -> TrainSummary:
    """Train a detector on the frames of the bags; an unfinished run with this configuration goes on.

    The run's folder `config.out` gets detector.safetensors, config.json, train.csv, loss.png, and
    while it runs state.pt, latest.safetensors and frames/ (the decoded frames). The result is the
    same whether or not the run was interrupted, for the same number of threads.
    """
    torch.set_num_threads(config.threads or os.cpu_count() or 1)
    out, checkpoint = config.out, config.out / "detector.safetensors"
    bags = [resolve_bag(bag) for bag in config.bags]
    resume = open_run(config, overwrite)
    store = store_frames(bags, config)
    batches = Batches(store, config)
    steps = config.steps or max(1, round(config.epochs * len(store) / config.batch_size))

    torch.manual_seed(config.seed)
    net = SecondNet(preset_named(config.preset)).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    state = TrainState(net, torch.optim.AdamW(net.parameters(), config.learning_rate, (0.9, 0.99)))
    for group in state.optimiser.param_groups:
        group["weight_decay"] = config.weight_decay
    if resume:
        state.restore(out / "state.pt")
    provenance = provenance_of(config, bags, len(store))

    log, grid, loss = TrainLog(out / "train.csv", state.step), net.anchor_grid(), float("nan")
    with interrupts() as interrupted:
        todo = range(state.step, steps)
        loaded = load_batches(batches, state.step, steps)
        for step, batch in track(zip(todo, loaded, strict=True), "train", total=len(todo)):
            rate = learning_rate(step, steps, config)
            parts, norm = train_step(state, batch, grid, rate, config)
            loss = float(parts.total.detach())
            log.add(step, rate, loss, float(parts.score), float(parts.box), float(parts.direction), norm)
            state.step = step + 1
            if state.step % config.checkpoint_every == 0 or state.step == steps or interrupted.is_set():
                state.save(out / "state.pt")
                about = {**provenance, "steps": str(state.step)}
                save_checkpoint(net, out / "latest.safetensors", about, overwrite=True)
            if interrupted.is_set():
                raise KeyboardInterrupt
    log.close()

    plot_losses(out / "train.csv", out / "loss.png")
    os.replace(out / "latest.safetensors", checkpoint)
    (out / "state.pt").unlink()
    shutil.rmtree(out / "frames")
    return TrainSummary(checkpoint, out / "train.csv", out / "loss.png", steps, len(store), loss, {})


def open_run(config: TrainConfig, overwrite: bool) -> bool:
    """Make the run's folder; whether it holds an unfinished run to go on with."""
    out = config.out
    wanted = json.dumps(asdict(config), default=str, indent=2, sort_keys=True) + "\n"
    config_file = out / "config.json"
    if overwrite and config_file.is_file():
        for name in ("detector.safetensors", "latest.safetensors", "state.pt", "train.csv", "loss.png"):
            (out / name).unlink(missing_ok=True)
    elif (out / "detector.safetensors").exists():
        raise OutputExistsError(out / "detector.safetensors")
    elif config_file.is_file() and config_file.read_text() != wanted:
        raise AdvpipeError(
            f"{out} holds an unfinished run with another configuration; pass --overwrite or another folder"
        )
    elif out.exists() and not config_file.is_file() and any(out.iterdir()):
        raise AdvpipeError(f"{out} is not empty and holds no training run; choose another folder")
    out.mkdir(parents=True, exist_ok=True)
    config_file.write_text(wanted)
    return (out / "state.pt").is_file()


def store_frames(bags: list[Path], config: TrainConfig) -> FrameStore:
    """The frames of the bags, decoded once, as far out as a turned range can reach."""
    r = preset_named(config.preset).range_m
    radius_m = 1.1 * max(abs(r.x_min_m), r.x_max_m) * 2**0.5

    def frames() -> Iterator[LabelledCloud]:
        for bag in bags:
            yield from track(read_frames(bag), f"read {bag.name}")

    key = [parent_sha256(bag) for bag in bags] + [radius_m]
    return FrameStore.build(frames(), config.out / "frames", key, radius_m)


def provenance_of(config: TrainConfig, bags: list[Path], frames: int) -> dict[str, str]:
    """What the checkpoint says about how it was trained."""
    return {
        "bags": json.dumps([{"name": bag.name, "sha256": parent_sha256(bag)} for bag in bags]),
        "frames": str(frames),
        "batch_size": str(config.batch_size),
        "learning_rate": str(config.learning_rate),
        "seed": str(config.seed),
        "threads": str(torch.get_num_threads()),
        "torch": torch.__version__,
        "augmentation": json.dumps(asdict(config.augmentation)),
    }


def learning_rate(step: int, steps: int, config: TrainConfig) -> float:
    """Linear warm-up from a tenth, then half a cosine down to a thousandth."""
    warm = config.warmup * steps
    if step < warm:
        return config.learning_rate * (0.1 + 0.9 * step / warm)
    done = (step - warm) / max(1.0, steps - warm)
    return config.learning_rate * (0.001 + 0.999 * (1 + cos(pi * done)) / 2)


def train_step(
    state: TrainState, batch: Batch, grid: AnchorGrid, rate: float, config: TrainConfig
) -> tuple[Losses, float]:
    """One step of the optimiser; the losses before it and the norm of the gradient before clipping."""
    net = state.net.train()
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    device = next(net.parameters()).device
    voxels = voxelise([points.to(device) for points in batch.points], net.preset)
    targets = [
        grid.assign(boxes.to(device), labels.to(device), ignored.to(device))
        for boxes, labels, ignored in zip(batch.boxes, batch.labels, batch.ignored, strict=True)
    ]
    parts = losses(net(voxels, bf16=config.bf16), targets, grid)
    if not torch.isfinite(parts.total):
        raise AdvpipeError(f"the loss is not finite at step {state.step}; lower learning_rate")
    state.optimiser.zero_grad()
    parts.total.backward()  # type: ignore[no-untyped-call]
    norm = float(torch.nn.utils.clip_grad_norm_(net.parameters(), config.clip_norm))
    state.optimiser.step()
    return parts, norm


@contextmanager
def interrupts() -> Iterator[threading.Event]:
    """Ctrl-C sets the event instead of breaking off a step, so that the state can be saved first."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return

    def note(_signal: int, _frame: FrameType | None) -> None:
        event.set()

    previous = signal.signal(signal.SIGINT, note)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, previous)
