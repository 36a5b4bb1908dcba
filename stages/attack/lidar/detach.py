"""Detachment: hide objects by removing a small share of a cloud's points."""

from __future__ import annotations

import math

import numpy as np

from advpipe.pipeline.bag.cloud import Cloud, xyzi
from advpipe.pipeline.baselines import remove_random_points
from advpipe.pipeline.detector.protocol import Detector, VoxelDetector
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.attack.lidar.base import LidarResult, PointLabels, unchanged
from advpipe.stages.attack.lidar.selection import (
    Indices,
    NoGradientError,
    Rule,
    choose_salient_points,
    choose_voxels,
)
from advpipe.stages.attack.lidar.targets import Targets, detection_loss, find_targets

RECIPES: dict[str, Rule | None] = {
    "best": choose_voxels,
    "paper": choose_salient_points,
    "random": None,
}
"""How the points are chosen; None is by chance."""


class Detach:
    """Remove exactly round(ratio * N) of a cloud's N points, in equal rounds.

    ratio: the share to remove, in (0, 1). Halves round up; at least one point goes, and one stays.
        Points that are not finite (rays without an echo, in some drivers) do not count and stay.
    recipe: "best" empties the voxels that the detector needs; "paper" is the greedy gradient-norm
        saliency of the paper (section III-A, Eq. 3); "random" is the baseline of equal budget.
    rounds: after each round the remaining points are ranked again (the paper: 10).
    """

    def __init__(self, *, ratio: float, recipe: str = "best", rounds: int = 10) -> None:
        if not 0 < ratio < 1:
            raise AdvpipeError(
                f"detach: ratio is {ratio}, but must lie between 0 and 1, such as 0.01 for 1 %"
            )
        if recipe not in RECIPES:
            raise AdvpipeError(f"detach: unknown recipe {recipe!r}; known: {', '.join(RECIPES)}")
        if not (rounds >= 1 and float(rounds).is_integer()):
            raise AdvpipeError(f"detach: rounds is {rounds}, but must be a whole number from 1 up")
        self.ratio, self.recipe, self.rounds = float(ratio), recipe, int(rounds)

    def budget(self, points: int) -> int:
        """How many of so many points are removed."""
        return min(max(1, math.floor(self.ratio * points + 0.5)), max(points - 1, 0))

    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: Detector, rng: np.random.Generator
    ) -> LidarResult:
        """The cloud without the chosen points; unchanged, with a note, where there is nothing to attack."""
        points = np.flatnonzero(np.isfinite(xyzi(cloud)).all(axis=1))
        budget = self.budget(len(points))
        if budget == 0:
            return unchanged(cloud, "no points to remove")
        targets = find_targets(detector, cloud, boxes)
        loss_before = detection_loss(detector, cloud, targets)
        rule, note = _rule_for(self.recipe, detector)
        if rule is None:
            removed = _by_chance(cloud, points, budget, rng)
        elif not len(targets):
            return unchanged(cloud, "no object to hide that the detector could find")
        else:
            removed, shortage = self._greedily(cloud, points, targets, detector, rule, rng)
            if not len(removed):
                return unchanged(cloud, shortage, loss_before)
            note = note or shortage
        adversarial = np.delete(cloud, removed)
        loss_after = detection_loss(detector, adversarial, targets)
        return LidarResult(adversarial, PointLabels.removed(removed), loss_before, loss_after, note)

    def _greedily(
        self,
        cloud: Cloud,
        points: Indices,
        targets: Targets,
        detector: Detector,
        rule: Rule,
        rng: np.random.Generator,
    ) -> tuple[Indices, str]:
        """Which of the points to remove, ranked again after each round; and what went short."""
        kept, removed = points, np.zeros(0, np.int64)
        goals = np.round(np.linspace(0, self.budget(len(points)), self.rounds + 1)).astype(int)
        for goal in goals[1:]:
            count = int(goal) - len(removed)
            if count == 0:  # fewer points to remove than rounds
                continue
            try:
                chosen = kept[rule(xyzi(cloud[kept]), targets, detector, count, rng)]
            except NoGradientError:
                if not len(removed):
                    return removed, "no gradient: the detector's loss depends on no point"
                rest = _by_chance(cloud, kept, int(goals[-1]) - len(removed), rng)
                return np.concatenate([removed, rest]), "gradient used up: the rest removed at random"
            removed = np.concatenate([removed, chosen])
            kept = np.setdiff1d(kept, chosen, assume_unique=True)
        return removed, ""


def _by_chance(cloud: Cloud, points: Indices, count: int, rng: np.random.Generator) -> Indices:
    """`count` of the points, by the baseline that every recipe is compared with."""
    return np.delete(points, remove_random_points(cloud[points], count, rng))


def _rule_for(recipe: str, detector: Detector) -> tuple[Rule | None, str]:
    """The recipe's rule for this detector, and what the user must know about it."""
    rule = RECIPES[recipe]
    if rule is choose_voxels and not isinstance(detector, VoxelDetector):
        return RECIPES["paper"], "recipe best needs a detector with occupancy_loss; used recipe paper"
    return rule, ""
