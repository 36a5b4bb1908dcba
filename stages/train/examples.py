"""Training clouds by their index in the run: index k is the same in every run with the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.common.network import DetectionNetwork, LabelledPoints
from advpipe.pipeline.messages.labels import IgnoredBoxes
from advpipe.stages.train.augment import ObjectBank, augment
from advpipe.stages.train.config import TrainConfig
from advpipe.stages.train.frames import FrameStore


class Examples:
    """Every frame once per epoch, in an order drawn per epoch, augmented by its index in the run."""

    def __init__(self, store: FrameStore, config: TrainConfig) -> None:
        self.store, self.config = store, config
        self.preset = config.network_preset
        self.bank = ObjectBank(store, config.min_points)

    def with_targets(self, index: int, net: DetectionNetwork) -> LabelledPoints:
        """Example `index`, with what the head of such a network is to learn from it."""
        example = self[index]
        return replace(example, targets=net.targets(example))

    def __getitem__(self, index: int) -> LabelledPoints:
        config = self.config
        epoch, row = divmod(index, len(self.store))
        order = named_generator(config.seed, "train", "order", epoch).permutation(len(self.store))
        rng = named_generator(config.seed, "train", "augment", index)
        frame = self.store.frame(int(order[row]))
        frame = augment(frame, config.augmentation, self.preset.voxel_size_m, rng, self.bank)
        return LabelledPoints(
            torch.from_numpy(frame.points),
            torch.from_numpy(frame.boxes.astype(np.float32)),
            torch.from_numpy(frame.labels),
            torch.from_numpy(frame.counts < config.min_points),
            Uncounted(IgnoredBoxes(frame.ignored), frame.coverage),
        )
