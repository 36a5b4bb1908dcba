"""Batches by their step in the run: step k is the same in every run with the same seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.image_detector.network import PRESETS, STRIDE
from advpipe.pipeline.image_detector.targets import Targets, targets_of
from advpipe.stages.train.camera.augment import section_of
from advpipe.stages.train.camera.config import ImageTrainConfig
from advpipe.stages.train.camera.pictures import PictureStore, learned_objects


@dataclass(frozen=True)
class Batch:
    """images: (B, 3, H, W); heat, boxes_px, weights: see `Targets`, with a first axis of B."""

    images: Tensor
    heat: Tensor
    boxes_px: Tensor
    weights: Tensor


class ImageExamples:
    """Every picture once per epoch, in an order drawn per epoch, augmented by its index in the run."""

    def __init__(self, store: PictureStore, config: ImageTrainConfig) -> None:
        self._store, self._config = store, config
        self._class_weights = 1 / np.sqrt(np.maximum(store.class_counts, 1))

    def batch(self, step: int) -> Batch:
        """What step `step` learns from."""
        size = self._config.batch_size
        made = [self._example(index) for index in range(step * size, (step + 1) * size)]
        images = np.stack([image for image, _ in made])
        targets = [each for _, each in made]
        return Batch(
            torch.from_numpy(images).contiguous(memory_format=torch.channels_last),
            torch.from_numpy(np.stack([each.heat for each in targets])),
            torch.from_numpy(np.stack([each.boxes_px for each in targets])),
            torch.from_numpy(np.stack([each.weights for each in targets])),
        )

    def _example(self, index: int) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.float32]], Targets]:
        config = self._config
        epoch, row = divmod(index, len(self._store))
        order = named_generator(config.seed, "train-camera", "order", epoch).permutation(len(self._store))
        rng = named_generator(config.seed, "train-camera", "augment", index)
        picture = self._store[int(order[row])]
        objects = learned_objects(picture, config.least_height_px, config.least_share)
        image, found = section_of(picture.rgb, objects, config.augmentation, self._class_weights, rng)
        width, height = config.augmentation.size_px
        n_classes = len(PRESETS[config.preset].classes)
        return image, targets_of(found, n_classes, -(-height // STRIDE), -(-width // STRIDE))
