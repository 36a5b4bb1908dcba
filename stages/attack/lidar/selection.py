"""Which points to remove next: one rule for each recipe of `detach`.

A rule takes the points (N, 4) float32 that are left, the targets, the detector, how many points to
choose, and a generator for ties. It returns the chosen indices, or raises `NoGradientError`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.detector.protocol import Detector, VoxelDetector
from advpipe.stages.attack.lidar.targets import Targets

Points = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]
Rule = Callable[[Points, Targets, Detector, int, np.random.Generator], Indices]


class NoGradientError(Exception):
    """The detector's loss does not depend on any point: there is nothing to follow."""


def choose_salient_points(
    points: Points, targets: Targets, detector: Detector, count: int, rng: np.random.Generator
) -> Indices:
    """The points with the largest gradient norm of the detection loss over x, y, z (the paper's Eq. 3)."""
    leaf = torch.from_numpy(points).requires_grad_()
    loss = detector.loss(leaf, targets.boxes, targets.labels)
    (gradient,) = torch.autograd.grad(loss, leaf)
    saliency = np.nan_to_num(gradient[:, :3].norm(dim=1).numpy(), posinf=0.0)
    if not saliency.any():
        raise NoGradientError
    return np.lexsort((rng.random(len(points)), -saliency))[:count]


def choose_voxels(
    points: Points, targets: Targets, detector: Detector, count: int, rng: np.random.Generator
) -> Indices:
    """Whole voxels whose emptying raises the loss most for each point it costs.

    Emptying voxel v changes the loss by -dL/d(occupancy of v), to first order; it costs the number
    of points in v. Voxels that fit into the budget are emptied in the order of gain per point; the
    rest of the budget goes to the next best voxel, which a later round may finish.
    """
    detector = cast(VoxelDetector, detector)
    loss, occupancy, voxel_of_point = detector.occupancy_loss(
        torch.from_numpy(points), targets.boxes, targets.labels
    )
    (gradient,) = torch.autograd.grad(loss, occupancy)
    voxel = voxel_of_point.numpy()
    read = voxel >= 0
    points_in = np.bincount(voxel[read], minlength=len(occupancy))
    gain = np.nan_to_num(-gradient.numpy(), posinf=0.0, neginf=0.0) / np.maximum(points_in, 1)
    if not gain.any():
        raise NoGradientError
    emptied = _fill_budget(gain, points_in, count)
    gain_of_point = np.where(read, gain[voxel], 0.0)
    in_emptied = np.where(read, emptied[voxel], False)
    return np.lexsort((rng.random(len(points)), -gain_of_point, ~in_emptied))[:count]


def _fill_budget(
    gain: npt.NDArray[np.floating], cost: npt.NDArray[np.int64], budget: int
) -> npt.NDArray[np.bool_]:
    """Greedy knapsack: items (V,) by falling positive gain, each taken when it still fits."""
    taken = np.zeros(len(gain), bool)
    for item in np.argsort(-gain, kind="stable"):
        if gain[item] <= 0 or budget == 0:
            break
        if cost[item] <= budget:
            taken[item] = True
            budget -= cost[item]
    return taken
