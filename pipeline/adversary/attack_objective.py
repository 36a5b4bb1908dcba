"""The objective that `detach` and `attach` maximise for each object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.detector.protocol import Detections, ObjectDetector
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

SCORE_LOSS_SHARE = 0.5
"""The objective of a found object whose score drops to 0: average precision hardly depends on the score."""

CREATED_SCORE = 0.7
"""A ghost object detected with this score needs no more points."""


@dataclass(frozen=True)
class AttackObjective:
    """Evaluates adversarial points by the detections that the detector returns for them.

    A lost object counts 1, plus false detections near it; an object found with a lower score counts the lost
    fraction of its score, times `SCORE_LOSS_SHARE`. An object that is not detected in the clean cloud counts
    0. A ghost object counts by the score and overlap with which it is detected.
    """

    goal: AttackGoal
    detector: ObjectDetector
    clean_success: Float64

    @property
    def clean_values(self) -> Float64:
        """The objective (M,) of the clean points."""
        return self.clean_success if self.goal.aim == "create" else np.zeros(len(self.clean_success))

    @staticmethod
    def of(goal: AttackGoal, detector: ObjectDetector, clean: Float32) -> AttackObjective:
        """The objective for attacks on these clean points (N, 4)."""
        return AttackObjective(goal, detector, goal.success(detector.detect(cloud_of_xyzi(clean))))

    def __call__(self, points: Float32) -> Float64:
        """The objective (M,) of each object of the goal for these points (K, 4)."""
        return self.value(self.detector.detect(cloud_of_xyzi(points)))

    def value(self, found: Detections) -> Float64:
        """The objective (M,) of each object of the goal if these are detected."""
        success, was = self.goal.success(found), self.clean_success
        if self.goal.aim == "create":
            return success
        partial = SCORE_LOSS_SHARE * np.clip((success - was) / np.maximum(-was, 1e-9), 0, 1)
        return np.where(was >= 0, 0.0, np.where(success >= 0, 1 + success, partial))

    def is_satisfied(self, values: Float64) -> npt.NDArray[np.bool_]:
        """Which objects (M,) need no more points: lost or never detected, or ghost objects that are found."""
        if self.goal.aim == "create":
            return np.asarray(values >= CREATED_SCORE)
        return np.asarray((values >= 1) | (self.clean_success >= 0))
