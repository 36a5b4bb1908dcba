"""How much each object of a goal has suffered: what `detach` and `attach` spend their budget by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.stages.attack.lidar.goal import Goal
from advpipe.stages.attack.lidar.per_object_best import cloud_of

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

FAINT = 0.5
"""The most that an object suffers by a lower score: average precision hardly asks how high it is."""

SEEN = 0.7
"""A ghost found so well needs no more."""


@dataclass(frozen=True)
class AttackObjective:
    """Judges points by what the detector makes of them.

    An object that is lost has suffered 1, and more by false detections beside it; one that is found with a
    lower score has suffered the share of `FAINT` that it lost of it. What the clean cloud did not show
    cannot suffer. A ghost's harm is how well it is seen.
    """

    goal: Goal
    detector: ObjectDetector
    clean_success: Float64

    @staticmethod
    def of(goal: Goal, detector: ObjectDetector, clean: Float32) -> AttackObjective:
        """The judge of changes of these clean points (N, 4)."""
        return AttackObjective(goal, detector, goal.success(detector.detect(cloud_of(clean))))

    def __call__(self, points: Float32) -> Float64:
        """The harm (M,) to the objects of the goal by these points (K, 4)."""
        success, was = self.goal.success(self.detector.detect(cloud_of(points))), self.clean_success
        if self.goal.kind == "create":
            return success
        faint = FAINT * np.clip((success - was) / np.maximum(-was, 1e-9), 0, 1)
        return np.where(was >= 0, 0.0, np.where(success >= 0, 1 + success, faint))

    def enough(self, harm: Float64) -> npt.NDArray[np.bool_]:
        """Which objects (M,) need no more: they are lost, or nobody saw them; ghosts that are seen."""
        if self.goal.kind == "create":
            return np.asarray(harm >= SEEN)
        return np.asarray((harm >= 1) | (self.clean_success >= 0))
