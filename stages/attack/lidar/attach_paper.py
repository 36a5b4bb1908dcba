"""Initialise and shift: the paper's way to add points (section III-A, after Xiang et al., CVPR 2019)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from advpipe.pipeline.adversary.constraints import Rules, along_rays
from advpipe.pipeline.adversary.displacement import ROUNDING_MARGIN
from advpipe.pipeline.adversary.goal import AttackGoal
from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.adversary.places import Places
from advpipe.pipeline.baselines import move_within
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.stages.attack.lidar.selection import choose_salient_points

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]

STEPS = 40
STEP_FRACTION = 1 / 30
"""Steps of eps / 30, as in the paper's perturbation; for attachment the paper states neither number."""


def salient_copies(
    clean: Float32,
    goal: AttackGoal,
    detector: ObjectDetector,
    rules: Rules,
    count: int,
    eps_m: float,
    weight: float,
    rng: np.random.Generator,
) -> Places:
    """`count` places of copies of the most salient clean points (N, 4), shifted by PGD.

    Minimises L = -L_det + weight * D_C (Eq. 1 and 4) over the copies' coordinates within the ball of radius
    eps around each start, with steps normalised for each point. If fewer points may be copied than are to be
    added, points are copied several times.
    """
    allowed = np.flatnonzero(rules.allowed)
    if not len(allowed):
        return Places(clean[:0], allowed, np.zeros(0), allowed)
    chosen = choose_salient_points(clean, goal.loss_targets, detector, count, rng, allowed)
    source = np.resize(chosen, count)
    start = clean[source]
    tree = cKDTree(clean[:, :3].astype(np.float64))
    offset = np.zeros((count, 3))
    for _ in range(STEPS):
        added = _at(start, offset)
        uphill = goal.sign * _gradient(clean, added, goal, detector)
        away_m = added[:, :3] - tree.data[tree.query(added[:, :3].astype(np.float64))[1]]
        # Only the added points' term of D_C depends on them; its gradient is 2 (z - nearest) / |P_a|.
        downhill = -uphill + weight * 2 * away_m / (len(clean) + count)
        length = np.linalg.norm(downhill, axis=1, keepdims=True)
        offset = offset - STEP_FRACTION * eps_m * downhill / np.maximum(length, 1e-30)
        if rules.constraints.along_ray:
            offset = along_rays(start[:, :3], offset)
        offset *= np.minimum(1, eps_m / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-30))
    permitted = rules.permits(_at(start, offset)[:, :3])
    points = _at(start, np.where(permitted[:, None], offset, 0.0))
    distance_m = np.linalg.norm(points[:, :3].astype(np.float64) - start[:, :3], axis=1)
    return Places(points, source, distance_m, np.full(count, -1, np.int64))


def _gradient(clean: Float32, added: Float32, goal: AttackGoal, detector: ObjectDetector) -> Float64:
    """dL_det / d(x, y, z) of the added points (K, 3)."""
    leaf: Tensor = torch.from_numpy(added).requires_grad_()
    points = torch.cat([torch.from_numpy(clean), leaf])
    loss = detector.loss(points, goal.loss_targets.boxes, goal.loss_targets.labels)
    (gradient,) = gradients_of(loss, leaf)
    slope: Float64 = np.nan_to_num(gradient[:, :3].double().cpu().numpy(), posinf=0.0, neginf=0.0)
    if not slope.any():
        raise NoGradientError
    return slope


def _at(start: Float32, offset_m: Float64) -> Float32:
    moved = start.copy()
    moved[:, :3] = move_within(start[:, :3], offset_m * (1 - ROUNDING_MARGIN))
    return moved
