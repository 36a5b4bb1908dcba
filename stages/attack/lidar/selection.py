"""The most salient points by the gradient of the loss, as in the paper."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch

from advpipe.pipeline.adversary.gradient import NoGradientError, gradients_of
from advpipe.pipeline.adversary.targets import AttackTargets
from advpipe.pipeline.detector.protocol import ObjectDetector

Points = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]


def choose_salient_points(
    points: Points,
    targets: AttackTargets,
    detector: ObjectDetector,
    count: int,
    rng: np.random.Generator,
    among: Indices,
) -> Indices:
    """The `count` points with the largest gradient norm of the detection loss (the paper's Eq. 3).

    points: (N, 4). among: (K,) the indices to choose from. Returns indices in descending order, ties
    in random order. Raises `NoGradientError` if all gradients are zero.
    """
    leaf = torch.from_numpy(points).requires_grad_()
    loss = detector.loss(leaf, targets.boxes, targets.labels)
    (gradient,) = gradients_of(loss, leaf)
    saliency = np.nan_to_num(gradient[:, :3].norm(dim=1).cpu().numpy(), posinf=0.0)
    if not saliency.any():
        raise NoGradientError
    return among[np.lexsort((rng.random(len(points))[among], -saliency[among]))[:count]]
