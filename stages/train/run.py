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
from math import cos, isfinite, pi
from pathlib import Path
from types import FrameType

import torch

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.detector.second.checkpoint import save_checkpoint
from advpipe.pipeline.detector.second.model import SecondNet
from advpipe.pipeline.detector.second.presets import preset_named
from advpipe.pipeline.errors import AdvpipeError, OutputExistsError
from advpipe.pipeline.progress import track
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.examples import Examples
from advpipe.stages.train.frames import FrameStore, LabelledCloud
from advpipe.stages.train.log import TrainLog, plot_losses
from advpipe.stages.train.state import TrainState
from advpipe.stages.train.workers import Gradients, gradients


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
    same whether or not the run was interrupted, and for any number of worker processes.
    """
    out, checkpoint = config.out, config.out / "detector.safetensors"
    bags = [resolve_bag(bag) for bag in config.bags]
    resume = open_run(config, overwrite)
    store = store_frames(bags, config)
    examples = Examples(store, config)
    steps = config.steps or max(1, round(config.epochs * len(store) / config.batch_size))
    workers = min(config.batch_size, config.workers or os.cpu_count() or 1)

    torch.manual_seed(config.seed)
    net = SecondNet(preset_named(config.preset)).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    state = TrainState.new(net, config.learning_rate, config.weight_decay)
    if resume:
        state.restore(out / "state.pt")
    provenance = provenance_of(config, bags, len(store))

    log, loss = TrainLog(out / "train.csv", state.step), float("nan")
    with interrupts() as interrupted, gradients(net, examples, workers) as gradients_of:
        for step in track(range(state.step, steps), "train", total=steps - state.step):
            rate = learning_rate(step, steps, config)
            parts, norm = train_step(state, gradients_of, rate, config.clip_norm)
            loss = sum(parts)
            log.add(step, rate, loss, *parts, norm)
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
    wanted = json.dumps({**asdict(config), "workers": None}, default=str, indent=2, sort_keys=True) + "\n"
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
    state: TrainState, gradients_of: Gradients, rate: float, clip_norm: float
) -> tuple[list[float], float]:
    """One step of the optimiser; the losses before it and the norm of the gradient before clipping."""
    for group in state.optimiser.param_groups:
        group["lr"] = rate
    parts: list[float] = gradients_of(state.step).tolist()
    norm = float(torch.nn.utils.clip_grad_norm_(state.net.parameters(), clip_norm))
    if not isfinite(sum(parts)) or not isfinite(norm):
        raise AdvpipeError(f"the loss is not finite at step {state.step}; lower learning_rate")
    state.optimiser.step()
    state.step += 1
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
