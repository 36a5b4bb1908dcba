"""Expectation over transformations: what a detector sees of attacked points under draws of defences.

An attack that is to hold however a cloud is changed before detection takes its gradients and judges its
candidates over random draws of such changes (Athalye et al., ICML 2018, "Synthesizing robust
adversarial examples"). One that is to hold on detectors that it does not know does so over views of the scene
(Xie et al., CVPR 2019, "Improving transferability of adversarial examples with input diversity").
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.input_diversity import InputDiversity
from advpipe.pipeline.adversary.targets import AttackTargets
from advpipe.pipeline.defences.base import Defence, Placement
from advpipe.pipeline.defences.placing import Flip, Shift
from advpipe.pipeline.defences.rounding import Jitter, Quantisation
from advpipe.pipeline.defences.thinning import OutlierRemoval, RandomSampling
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import cloud_of_xyzi, xyzi

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

MOMENTUM = 0.5
"""The weight of earlier rounds where views are drawn anew in each (Dong et al., CVPR 2018, "Boosting
adversarial attacks with momentum", have 1 at unit lengths)."""

MIRRORED = (True, False, True)
"""Which of the other views are mirrored: some in every round, as crossings of faces do not survive that."""


@dataclass(frozen=True)
class View:
    """Points under one draw: points (K, 4) float32 as the detector sees them, the row (K,) among the given
    ones that each comes from, and how the scene is placed."""

    points: Float32
    source: Int64
    placement: Placement

    def targets(self, targets: AttackTargets) -> AttackTargets:
        """The targets where this draw places them."""
        boxes = self.placement.boxes_there(targets.boxes.double().numpy())
        return AttackTargets(torch.from_numpy(boxes.astype(np.float32)), targets.labels)

    def probes(self, probes: Float32) -> Float32:
        """Other points (G, 4) of the given frame, placed alike; without noise, and all of them."""
        return xyzi(self.placement.cloud(cloud_of_xyzi(probes)))

    def found_back(self, found: Detections) -> Detections:
        """Detections in this view, in the frame of the given points."""
        return replace(found, boxes=self.placement.boxes_back(found.boxes))


@dataclass(frozen=True)
class Expectation:
    """The transformations that an attack is to hold under: each a group of defences in a row.

    momentum: the weight of earlier rounds in the gains of points removed and added.
    """

    groups: tuple[tuple[Defence, ...], ...]
    momentum: float = 0.0

    def __len__(self) -> int:
        return len(self.groups)

    def views(self, points: Float32, rng: np.random.Generator) -> list[View]:
        """One view of points (N, 4) for each transformation, newly drawn; the first is of none."""
        return [_view(points, group, rng) for group in self.groups]

    @staticmethod
    def of_defences(clean: Float32) -> Expectation:
        """The draws that stand for the six default defences, in an attack on these clean points (N, 4): none,
        a flip, a sub-voxel shift, and a shift with noise, rounding, random and outlier removal.

        The limit of outlier removal is that of the whole clean cloud: the part of it that a search looks at
        would have another one.
        """
        outliers = OutlierRemoval().limited_by(cloud_of_xyzi(clean))
        thinned = (Shift(), Jitter(), Quantisation(), RandomSampling(), outliers)
        return Expectation(((), (Flip(),), (Shift(),), thinned))

    @staticmethod
    def of_views(clean: Float32) -> Expectation:
        """The scene of points (N, 4) as it is, and three other views of it, two of them mirrored."""
        del clean
        return Expectation(((), *((InputDiversity(mirrored),) for mirrored in MIRRORED)), MOMENTUM)


EXPECTATIONS: Mapping[str, Callable[[Float32], Expectation]] = {
    "robust": Expectation.of_defences,
    "transfer": Expectation.of_views,
}
"""The recipes that take an expectation, and which, of an attack on clean points (N, 4)."""


def _view(points: Float32, group: Sequence[Defence], rng: np.random.Generator) -> View:
    cloud, placement = cloud_of_xyzi(points), Placement()
    cloud["time"] = np.arange(len(points))  # exact in float32 up to 16 million points; no defence reads it
    for defence in group:
        defended = defence(cloud, rng)
        cloud = defended.cloud
        placement = placement.followed_by(defended.placement)
    return View(xyzi(cloud), cloud["time"].astype(np.int64), placement)
