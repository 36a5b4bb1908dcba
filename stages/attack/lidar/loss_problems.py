"""The problems of `detach` and `attach` for detectors without `occupancy_loss`: gains by a surrogate, or else
by the loss alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.addition_problem import AdditionProblem
from advpipe.pipeline.adversary.attack_objective import AttackObjective
from advpipe.pipeline.adversary.goal import owners
from advpipe.pipeline.adversary.gradient import gradients_of
from advpipe.pipeline.adversary.removal_problem import RemovalProblem
from advpipe.pipeline.adversary.surrogate import proposing
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import cloud_of_xyzi
from advpipe.stages.attack.lidar.attach_problem import addition_gains
from advpipe.stages.attack.lidar.detach_problem import removal_gains

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(eq=False)
class LossRemovalProblem(RemovalProblem):
    """Its items are the points; a `SubsetProblem`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._boxes = self.objective.goal.targets.boxes.double().numpy()
        self.item_owner, self.item_xyz_m = self.owner, self.points[:, :3].astype(np.float64)
        self.is_inside = owners(self.points[:, :3], self._boxes, 0.0) >= 0
        self.item_gains, self.has_gradient = np.zeros(len(self.points)), True

    def detected(self, points: Float32, left: Int64, will_propose: bool) -> Detections:
        """What the detector finds, and the gains: those of a surrogate, if there is one; else to the first
        order, dropping a point is like moving it to its object's centre, where it carries no information
        (Zheng et al. 2019, "PointCloud Saliency Maps", section 3.2)."""
        surrogate = proposing(self.objective.detector)
        if will_propose and surrogate is not None:
            _, self.item_gains[left], _ = removal_gains(self.objective.goal, surrogate, points)
        elif will_propose and self.has_gradient:
            slope = attack_gradient(self.objective, points)
            to_centre_m = self._boxes[self.owner[left], :3] - points[:, :3]
            self.item_gains[left] = (slope * to_centre_m).sum(axis=1)
            self.has_gradient = bool(slope.any())
        return super().detected(points, left, will_propose)


@dataclass(eq=False)
class LossAdditionProblem(AdditionProblem):
    """Its items are the places; a `SubsetProblem`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        boxes, places = self.objective.goal.targets.boxes.double().numpy(), self.places.points[:, :3]
        self.item_owner, self.item_xyz_m = self.places.owner, places.astype(np.float64)
        self.is_inside = owners(places, boxes, 0.0) >= 0
        self.item_gains, self.has_gradient = np.zeros(len(places)), True

    def look(self, taken: Int64, *, will_propose: bool) -> Float64:
        points, shown = self.seen(taken)
        surrogate = proposing(self.objective.detector)
        if will_propose and surrogate is not None:
            goal, places = self.objective.goal, self.places.points
            _, self.item_gains = addition_gains(goal, surrogate, points, places)
        elif will_propose and self.has_gradient:
            slope = np.zeros((len(self.clean) + len(self.places), 3))
            slope[shown] = attack_gradient(self.objective, points)
            # To the first order: a copy of the place's clean point, moved to the place.
            source = self.places.source
            way_m = self.item_xyz_m - self.clean[source, :3]
            self.item_gains = (slope[source] * way_m).sum(axis=1)
            self.has_gradient = bool(slope.any())
        return self.objective.value(self.objective.detector.detect(cloud_of_xyzi(points)))


def attack_gradient(objective: AttackObjective, points: Float32) -> Float64:
    """The gradient (N, 3) of the loss to the coordinates of points (N, 4), in the direction of the attack;
    zero where it is not finite."""
    goal, leaf = objective.goal, torch.from_numpy(points.copy()).requires_grad_()
    loss = objective.detector.loss(leaf, goal.loss_targets.boxes, goal.loss_targets.labels)
    (gradient,) = gradients_of(loss, leaf)
    slope = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
    rise: Float64 = goal.sign * slope
    return rise
