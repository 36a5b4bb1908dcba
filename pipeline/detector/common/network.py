"""The interface of trainable networks of all families, and the detector made from a trained network."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import reduce
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.preset import Preset
from advpipe.pipeline.detector.expected_input import ExpectedInput, with_trained_height
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector, Range
from advpipe.pipeline.detector.training_maps import KEY, listed_maps
from advpipe.pipeline.messages.cloud import xyzi


@dataclass(frozen=True)
class LabelledPoints:
    """points: (N, 4) float32 x, y, z in metres and intensity. boxes: (M, 7) float32, columns
    `geometry.boxes.BOX_COLUMNS`. labels: (M,) int64, index into the network's classes. ignored: (M,) bool,
    boxes with too few points to learn from; None: there are none. uncounted: where it is unknown what is
    background, in the frame of the points; None: nowhere. targets: what `DetectionNetwork.targets` makes of
    these; None: not made yet."""

    points: Tensor
    boxes: Tensor
    labels: Tensor
    ignored: Tensor | None = None
    uncounted: Uncounted | None = None
    targets: Any = None

    def to(self, device: torch.device) -> LabelledPoints:
        """The same on a device."""
        points, boxes, labels = (part.to(device) for part in (self.points, self.boxes, self.labels))
        ignored = None if self.ignored is None else self.ignored.to(device)
        return LabelledPoints(points, boxes, labels, ignored, self.uncounted, _moved(self.targets, device))


def _moved(targets: Any, device: torch.device) -> Any:
    """A dataclass of tensors on a device."""
    if not is_dataclass(targets) or isinstance(targets, type):
        return targets
    return replace(targets, **{each.name: getattr(targets, each.name).to(device) for each in fields(targets)})


class DetectionNetwork(nn.Module, ABC):
    """A network that can be trained, saved in a checkpoint, and used for detection.

    LOSS_PARTS: names of the summands of the training loss, which are columns of the training log; each ends
    with `_loss`. The running means and variances of its batch norms, the only state besides its weights, are
    buffers named `running_mean` and `running_var`.
    """

    LOSS_PARTS: ClassVar[tuple[str, ...]]
    preset: Preset

    @abstractmethod
    def training_losses(self, cloud: LabelledPoints, *, bf16: bool = False) -> tuple[Tensor, ...]:
        """The weighted parts of the loss on one cloud, scalars in the order of `LOSS_PARTS`, which can be
        differentiated with respect to the weights and the points; boxes out of range are ignored.

        bf16: computed in half precision where that is safe.
        """

    def targets(self, cloud: LabelledPoints) -> Any:
        """What the head is to learn from a cloud, a dataclass of tensors: processes that prepare clouds make
        it, so that a GPU need not wait; None where a network makes it in `training_losses`."""

    def batch_losses(self, clouds: Sequence[LabelledPoints], *, bf16: bool = False) -> Tensor:
        """The parts of `training_losses` (P,), averaged over clouds that share batch norm statistics, if the
        network computes them together."""
        return torch.stack([torch.stack(self.training_losses(cloud, bf16=bf16)) for cloud in clouds]).mean(0)

    @abstractmethod
    def detections(self, clouds: Sequence[Tensor]) -> list[Detections]:
        """The objects in each of the clouds (N_i, 4), labels by the preset's classes, best first."""

    @abstractmethod
    def detector(self, provenance: Mapping[str, str]) -> ObjectDetector:
        """The trained network as a detector: a `NetworkDetector`, or a subclass with more capabilities."""

    @property
    def device(self) -> torch.device:
        return next(self.parameters()).device


N = TypeVar("N", bound=DetectionNetwork)


class NetworkDetector(Generic[N]):
    """A trained network as an `ObjectDetector`: frozen weights, frozen batch norm.

    It computes on its network's device. Input tensors may be on any device, and results are on the device of
    the input points.
    """

    def __init__(self, net: N, provenance: Mapping[str, str] | None = None) -> None:
        self.net: N = net.eval().requires_grad_(False)
        self.provenance = dict(provenance or {})

    @property
    def training_maps_sha256(self) -> Sequence[str | None] | None:
        """The maps of the drives it was trained on, as `KnowsItsMaps` has them."""
        return listed_maps(self.provenance.get(KEY))

    @property
    def expected_input(self) -> ExpectedInput | None:
        """What it was trained on, else what its preset is made for."""
        return with_trained_height(self.net.preset.expected_input, self.provenance)

    @property
    def device(self) -> torch.device:
        return self.net.device

    @property
    def classes(self) -> tuple[str, ...]:
        return self.net.preset.classes

    @property
    def range_m(self) -> Range:
        return self.net.preset.range_m

    def detect(self, cloud: npt.NDArray[np.void]) -> Detections:
        """The objects in a cloud (N,); points that are not finite are ignored."""
        return self.detect_batch([torch.from_numpy(xyzi(cloud))])[0]

    @torch.no_grad()
    def detect_batch(self, clouds: Sequence[Tensor]) -> list[Detections]:
        """The objects in each of the clouds (N_i, 4)."""
        return self.net.detections([cloud.to(self.device) for cloud in clouds])

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        """The training loss of one cloud, see `ObjectDetector.loss`; all boxes in range count.

        Raises AdvpipeError for points that are not finite.
        """
        require_finite([points])
        parts = self.net.training_losses(LabelledPoints(points, boxes, labels).to(self.device))
        return reduce(torch.add, parts).to(points.device)


def require_finite(clouds: Sequence[Tensor]) -> None:
    """Raise AdvpipeError for points that are not finite, which have no gradient."""
    if not all(torch.isfinite(each).all() for each in clouds):
        raise AdvpipeError("the cloud has points that are not finite; remove them before computing a loss")
