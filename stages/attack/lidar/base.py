"""What a LiDAR attack is: one frame and a detector in; the adversarial cloud and its labels out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.messages.cloud import Cloud

REMOVED = "removed"
"""The action on a point that the adversarial cloud no longer holds."""


NO_GRADIENT = "no gradient: the detector's loss depends on no point"
"""The note on a frame where there is nothing to follow."""


@dataclass(frozen=True)
class PointLabels:
    """What was done to the K touched points of one cloud.

    point: (K,) int64, index in the clean cloud, ascending.
    action: (K,) str, what was done to it.
    displacement_m: (K,) float64, how far it was moved; NaN for a removed point.
    """

    point: npt.NDArray[np.int64]
    action: npt.NDArray[np.str_]
    displacement_m: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.point)

    @staticmethod
    def removed(points: npt.NDArray[np.int64]) -> PointLabels:
        """Labels of points (K,) that were taken away."""
        return PointLabels(np.sort(points), np.full(len(points), REMOVED), np.full(len(points), np.nan))


@dataclass(frozen=True)
class LidarResult:
    """The adversarial version of one cloud: the points that it keeps in their order, then those added.

    loss_before, loss_after: the detector's loss on the clean and on the adversarial cloud; NaN
    where the frame has no object to take a loss for.
    note: what the user must know about this frame, such as why it was left as it was; mostly "".
    """

    cloud: Cloud
    labels: PointLabels
    loss_before: float = np.nan
    loss_after: float = np.nan
    note: str = ""


def unchanged(cloud: Cloud, note: str, loss: float = np.nan) -> LidarResult:
    """A frame that the attack leaves as it was, and why; the note must tell."""
    return LidarResult(cloud, PointLabels.removed(np.zeros(0, np.int64)), loss, loss, note)


def told(*notes: str) -> str:
    """Several notes on a frame as one; those that say nothing are left out."""
    return "; ".join(filter(None, notes))


class LidarAttack(Protocol):
    """An attack on clouds. Its constructor takes the hyper-parameters, keyword-only, and checks them.

    Its instances may have a whole number `looks`: to how many tries it looks at what the detector finds in
    them, to keep the best. The random baselines then get as many. Its class may have `only_for`: parameters
    that some recipes alone look at, by name, with these recipes; set for another one they are refused.
    """

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: Detector, rng: np.random.Generator
    ) -> LidarResult:
        """Attack one cloud (N,) with its ground truth `boxes` in the cloud's frame."""
