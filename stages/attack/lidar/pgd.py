"""Projected gradient descent (PGD) on points, as in the paper."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.adversary.constraints import Constraints, Rules
from advpipe.pipeline.adversary.displacement import displaced
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.detector.protocol import ObjectDetector

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

STEP_FRACTION = 1 / 30
"""A step as a fraction of the reach (section IV-B of the paper: alpha = eps / 30)."""


@dataclass(frozen=True)
class ProjectedGradientDescent:
    """PGD on points (N, 4) as in Eq. 1 and 2 of the paper; intensities stay.

    The loss is L = -sign * L_det + weight * sum of squared displacements, the weight in its units a square
    metre. It starts from U(-reach, reach) in each coordinate, projected into the ball; each step goes
    reach / 30 against the gradient, normalised for each point, and is projected again. near: (N,) the only
    points that move.
    """

    points: Float32
    goal: AttackGoal
    detector: ObjectDetector
    rules: Rules
    near: Bool
    reach_m: float
    rng: np.random.Generator
    weight: float = 0.0

    def candidates(self, steps: int) -> Iterator[Float32]:
        """Each iterate; fewer if the gradient vanishes."""
        points, rules, reach_m = self.points, self.rules, self.reach_m
        start = torch.from_numpy(points)
        drawn = torch.from_numpy(self.rng.uniform(-reach_m, reach_m, (len(points), 3)).astype(np.float32))
        worth = rules.allowed.astype(np.float64)
        if rules.constraints.max_points is not None:  # the most salient ones
            still = torch.zeros_like(drawn)
            worth *= loss_gradient(start, still, self.goal, self.detector).norm(dim=1).numpy()
        allowed = rules.limit(worth) & self.near
        offset = _permitted(project(drawn, reach_m), rules, allowed)
        for number in range(steps):
            try:
                gradient = loss_gradient(start, offset, self.goal, self.detector)
            except NoGradientError:
                if number == 0:
                    raise
                break
            total = -self.goal.sign * gradient + 2 * self.weight * offset
            length = total.norm(dim=1, keepdim=True)
            unit = total / length.clamp(min=1e-30)
            offset = _permitted(project(offset - STEP_FRACTION * reach_m * unit, reach_m), rules, allowed)
            yield displaced(points, offset.numpy(), reach_m)

    def accept(self, better: Bool) -> None:
        """Ignored: PGD continues from its latest iterate."""


def loss_gradient(start: Tensor, offset: Tensor, goal: AttackGoal, detector: ObjectDetector) -> Tensor:
    """The gradient (N, 3) of the detector's loss to the points (N, 4) displaced by an offset (N, 3)."""
    leaf = start.clone()
    leaf[:, :3] += offset
    leaf.requires_grad_()
    loss = detector.loss(leaf, goal.loss_targets.boxes, goal.loss_targets.labels)
    (gradient,) = gradients_of(loss, leaf)
    rises = torch.nan_to_num(gradient[:, :3], posinf=0.0, neginf=0.0)
    if not rises.any():
        raise NoGradientError
    return rises


def _permitted(offset: Tensor, rules: Rules, allowed: Bool) -> Tensor:
    """Displacements (N, 3) projected to what the constraints allow."""
    if rules.constraints != Constraints():
        offset = torch.from_numpy(rules.project(offset.numpy()).astype(np.float32))
    return offset if allowed.all() else offset * torch.from_numpy(allowed)[:, None]


def project(offset: Tensor, reach_m: float) -> Tensor:
    """Displacements (N, 3), those longer than the reach shortened to it (the paper's Clip)."""
    length = offset.norm(dim=1, keepdim=True)
    return torch.where(length > reach_m, offset * (reach_m / length), offset)
