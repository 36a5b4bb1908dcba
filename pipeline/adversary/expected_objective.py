"""The objective of `detach` and `attach` in expectation over transformations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.expectation import Expectation, View
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import cloud_of_xyzi

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]


LOST_WEIGHT = 0.1
"""The weight of a transformation in the gains of an object that is lost under it; 1 where it is found."""


def still_found(goal: AttackGoal, found: Sequence[Detections]) -> Float64:
    """The weight of each transformation, for each object and decoy (T, M + D), if these are detected."""
    return np.where([goal.is_done(goal.success(each)) for each in found], LOST_WEIGHT, 1.0)


@dataclass(frozen=True)
class ExpectedObjective(AttackObjective):
    """The mean over the transformations of what an object counts under each.

    A lost object counts 1 under a transformation, no more; so an object is lost, and needs no more points,
    only where it is lost under all. One under which it is not found in the clean cloud does not count.
    rng: of the draws. seen: (T, M), what the objects count in the clean cloud under each transformation.
    """

    expectation: Expectation
    rng: np.random.Generator
    seen: tuple[AttackObjective, ...]

    @staticmethod
    def over(
        plain: AttackObjective, clean: Float32, expectation: Expectation, rng: np.random.Generator
    ) -> ExpectedObjective:
        """The objective for attacks on these clean points (N, 4), which takes a pass a transformation."""
        seen = []
        for view in expectation.views(clean, rng):
            found = view.found_back(plain.detector.detect(cloud_of_xyzi(view.points)))
            seen.append(replace(plain, clean_success=plain.goal.success(found)))
        return ExpectedObjective(
            plain.goal, plain.detector, plain.clean_success, expectation, rng, tuple(seen)
        )

    def views(self, points: Float32) -> list[View]:
        """Points (K, 4) under a new draw of each transformation."""
        return self.expectation.views(points, self.rng)

    def __call__(self, points: Float32) -> Float64:
        views = self.views(points)
        return self.expected([self.detector.detect(cloud_of_xyzi(view.points)) for view in views], views)

    def weights(self, found: Sequence[Detections], views: Sequence[View]) -> Float64:
        """How much the gains of each view count for each object, (T, M): little where it is lost already."""
        back = [view.found_back(each) for view, each in zip(views, found, strict=True)]
        weights: Float64 = still_found(self.goal, back)[:, : len(self.goal.targets)]
        return weights

    def expected(self, found: Sequence[Detections], views: Sequence[View]) -> Float64:
        """The objective (M,) if these are detected in the views, each in its own frame."""
        back = [view.found_back(each) for view, each in zip(views, found, strict=True)]
        values = np.array([seen.value(each) for seen, each in zip(self.seen, back, strict=True)])
        counts = np.array([seen.clean_success < 0 for seen in self.seen])
        if self.goal.aim == "create":
            counts = np.ones_like(counts)
        mean: Float64 = np.minimum(values, 1).sum(axis=0, where=counts) / np.maximum(counts.sum(axis=0), 1)
        return mean
