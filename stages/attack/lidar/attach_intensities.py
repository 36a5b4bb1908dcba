"""The intensities of the points that `attach` adds, where the attacker chooses them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import gradients_of
from advpipe.pipeline.adversary.places import Places
from advpipe.pipeline.detector.protocol import ObjectDetector

Float32 = npt.NDArray[np.float32]


def attach_intensities(
    clean: Float32, places: Places, goal: AttackGoal, objective: AttackObjective, detector: ObjectDetector
) -> Places:
    """The places with intensities of 0 or 1, by the sign of the gradient, if that raises the objective."""

    def loss_of(added: Float32) -> tuple[torch.Tensor, torch.Tensor]:
        points = torch.from_numpy(np.concatenate([clean, added])).requires_grad_()
        return goal.sign * detector.loss(points, goal.loss_targets.boxes, goal.loss_targets.labels), points

    loss, points = loss_of(places.points)
    (gradient,) = gradients_of(loss, points)
    slope = gradient[len(clean) :, 3].cpu().numpy()
    changed = places.points.copy()
    changed[:, 3] = np.where(slope > 0, 1.0, np.where(slope < 0, 0.0, changed[:, 3]))
    before, after = (
        (float(objective(np.concatenate([clean, added])).sum()), float(loss_of(added)[0].detach()))
        for added in (places.points, changed)
    )
    return replace(places, points=changed) if after > before else places
