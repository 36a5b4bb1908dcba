"""Several detectors that an attack is made against at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.joint_voxels import joint_occupancy_loss
from advpipe.pipeline.detector.protocol import (
    Detections,
    ObjectDetector,
    OccupancyLoss,
    Range,
    VoxelDetector,
    VoxelGrid,
)
from advpipe.pipeline.geometry.iou import iou_bev
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

if TYPE_CHECKING:
    from torch import Tensor

Int64 = npt.NDArray[np.int64]

SAME_OBJECT_IOU = 0.1
"""Boxes of one class that overlap by more, seen from above, are of one object."""


@dataclass(frozen=True)
class EnsembleDetections(Detections):
    """What the members of an ensemble detect, all together; members may find the same object.

    member: (K,) int64, which of the `members` each detection is from.
    """

    member: Int64
    members: int

    @staticmethod
    def joined(found: Sequence[Detections]) -> EnsembleDetections:
        """Those of each member, with labels by the same classes."""
        scores = np.concatenate([each.scores for each in found])
        order = np.argsort(-scores, kind="stable")
        return EnsembleDetections(
            np.concatenate([each.boxes.reshape(-1, 7) for each in found])[order],
            scores[order],
            np.concatenate([each.labels for each in found])[order],
            np.repeat(np.arange(len(found)), [len(each) for each in found])[order],
            len(found),
        )

    def of_members(self) -> Iterator[Detections]:
        """What each member detects by itself."""
        for number in range(self.members):
            mine = self.member == number
            yield Detections(self.boxes[mine], self.scores[mine], self.labels[mine])

    def merged(self) -> Detections:
        """One box for each object: of those that overlap, the one with the highest score."""
        alike = (iou_bev(self.boxes, self.boxes) > SAME_OBJECT_IOU) & (self.labels[:, None] == self.labels)
        kept: list[int] = []
        for number in range(len(self)):
            if not alike[number, kept].any():
                kept.append(number)
        return Detections(self.boxes[kept], self.scores[kept], self.labels[kept])


class DetectorEnsemble:
    """An `ObjectDetector` of several members; made by `ensemble_of`.

    Its classes and its range are those of all members together. Each member gets the boxes of its own classes
    in its own range. `loss` is the mean of the members' losses.
    """

    def __init__(self, members: Sequence[ObjectDetector]) -> None:
        self.members = tuple(members)
        self._classes = tuple(dict.fromkeys(name for each in self.members for name in each.classes))
        self._label_here = [
            np.array([self._classes.index(name) for name in each.classes], np.int64) for each in self.members
        ]

    @property
    def classes(self) -> tuple[str, ...]:
        return self._classes

    @property
    def range_m(self) -> Range:
        ranges = [list(vars(each.range_m).values()) for each in self.members]
        return Range(*np.min(ranges, axis=0)[:3].tolist(), *np.max(ranges, axis=0)[3:].tolist())

    def detect(self, cloud: npt.NDArray[np.void]) -> EnsembleDetections:
        """What all members detect."""
        return self._joined([each.detect(cloud) for each in self.members])

    def loss(self, points: Tensor, boxes: Tensor, labels: Tensor) -> Tensor:
        import torch

        return torch.stack(
            [
                each.loss(points, *self._targets(number, boxes, labels))
                for number, each in enumerate(self.members)
            ]
        ).mean()

    def _joined(self, found: Sequence[Detections]) -> EnsembleDetections:
        return EnsembleDetections.joined(
            [
                replace(each, labels=here[each.labels])
                for each, here in zip(found, self._label_here, strict=True)
            ]
        )

    def _targets(self, number: int, boxes: Tensor, labels: Tensor) -> tuple[Tensor, Tensor]:
        """The boxes (M, 7) that a member can find, with its own labels."""
        import torch

        member = self.members[number]
        there = np.full(len(self.classes), -1, np.int64)
        there[self._label_here[number]] = np.arange(len(member.classes))
        own = there[labels.cpu().numpy()]
        mine = (own >= 0) & member.range_m.contains_centres(boxes.detach().cpu().double().numpy())
        chosen = torch.from_numpy(np.flatnonzero(mine)).to(boxes.device)
        return boxes[chosen], torch.from_numpy(own[mine]).to(labels.device)


class VoxelEnsemble(DetectorEnsemble):
    """An ensemble of detectors on voxels, itself a `VoxelDetector`; see `joint_occupancy_loss`.

    Its passes tell what is found, even if that takes some members a pass more.
    """

    def __init__(self, members: Sequence[VoxelDetector]) -> None:
        super().__init__(members)
        self._voxel_members = tuple(members)

    @property
    def voxel_grid(self) -> VoxelGrid:
        """The finest grid of its members: a point that crosses a face of another grid crosses cells of this
        one, too."""
        return min((each.voxel_grid for each in self._voxel_members), key=lambda grid: np.prod(grid.size_m))

    def occupancy_loss(
        self, points: Tensor, boxes: Tensor, labels: Tensor, probes: Tensor | None = None
    ) -> OccupancyLoss:
        computed = [
            each.occupancy_loss(points, *self._targets(number, boxes, labels), probes)
            for number, each in enumerate(self._voxel_members)
        ]
        found = [
            member.detect(cloud_of_xyzi(points.detach().cpu().numpy())) if each.found is None else each.found
            for member, each in zip(self.members, computed, strict=True)
        ]
        return replace(joint_occupancy_loss(computed, points), found=self._joined(found))


def ensemble_of(members: Sequence[ObjectDetector]) -> DetectorEnsemble:
    """The ensemble of two members or more; one on voxels where all of them are."""
    on_voxels = [each for each in members if isinstance(each, VoxelDetector)]
    return VoxelEnsemble(on_voxels) if len(on_voxels) == len(members) else DetectorEnsemble(members)
