"""Batches by their number: batch k of a seed is the same in every run, resumed or not."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from advpipe.pipeline.detector.second.presets import preset_named
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.train.augment import ObjectBank, augment
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.frames import FrameStore


@dataclass(frozen=True)
class Batch:
    """One entry a cloud: points (N, 4), boxes (M, 7), labels (M,), ignored (M,)."""

    points: list[Tensor]
    boxes: list[Tensor]
    labels: list[Tensor]
    ignored: list[Tensor]


class Batches(Dataset[Batch]):
    """Every frame once an epoch, in an order of the epoch's own, augmented by its place in the run."""

    def __init__(self, store: FrameStore, config: TrainConfig) -> None:
        self.store, self.config = store, config
        self.preset = preset_named(config.preset)
        self.bank = ObjectBank(store, config.min_points)

    def __getitem__(self, step: int) -> Batch:
        frames = [self._frame(step * self.config.batch_size + b) for b in range(self.config.batch_size)]
        return Batch(*(list(column) for column in zip(*frames, strict=True)))

    def _frame(self, position: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        config = self.config
        epoch, place = divmod(position, len(self.store))
        order = named_generator(config.seed, "train", "order", epoch).permutation(len(self.store))
        rng = named_generator(config.seed, "train", "augment", position)
        frame = self.store.frame(int(order[place]))
        frame = augment(frame, config.augmentation, self.preset.voxel_size_m, rng, self.bank)
        return (
            torch.from_numpy(frame.points),
            torch.from_numpy(frame.boxes.astype(np.float32)),
            torch.from_numpy(frame.labels),
            torch.from_numpy(frame.counts < config.min_points),
        )


def load_batches(batches: Batches, first: int, last: int) -> Iterator[Batch]:
    """Batches first to last - 1, made ahead in a process of their own."""
    loader = DataLoader(
        batches,
        batch_size=None,
        sampler=range(first, last),
        num_workers=1,
        prefetch_factor=3,
        worker_init_fn=_leave_interrupts_to_the_parent,
    )
    return iter(loader)


def _leave_interrupts_to_the_parent(_: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
