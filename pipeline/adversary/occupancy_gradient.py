"""The gradient to voxel occupancy that attacks follow, also against ensembles."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from advpipe.pipeline.adversary.expected_objective import still_found
from advpipe.pipeline.adversary.goal import AttackGoal, owners
from advpipe.pipeline.adversary.gradient import gradients_of
from advpipe.pipeline.adversary.random_best import MOVE_MARGIN_M
from advpipe.pipeline.detector.ensemble import EnsembleDetections
from advpipe.pipeline.detector.joint_voxels import JointOccupancyLoss
from advpipe.pipeline.detector.protocol import Detections, OccupancyLoss

Float32 = npt.NDArray[np.float32]


def occupancy_gradients(
    computed: OccupancyLoss,
    goal: AttackGoal,
    places: Float32,
    *leaves: Tensor,
    found: Detections | None = None,
) -> list[Tensor]:
    """The gradient (V,) of the loss to the occupancy, and those to other leaves.

    Of an ensemble, a member's gradient counts little near an object that this member does not find any
    more, like that of a view in `ExpectedObjective`: what is left of a budget goes to the others.
    places: (N + G, 3) or more columns, the points and the probe points, in the frame of the goal.
    found: what is detected, in that frame; by default what `computed` holds.
    """
    gradient, *others = gradients_of(computed.loss, computed.occupancy, *leaves)
    found = computed.found if found is None else found
    if isinstance(computed, JointOccupancyLoss) and isinstance(found, EnsembleDetections):
        weights = still_found(goal, list(found.of_members()))
        weights = np.append(weights, np.ones((len(weights), 1)), axis=1)  # of owner -1: near no object
        row = computed.rows.cpu().numpy()
        cell, first = np.unique(row, return_index=True)
        first = first[cell >= 0]  # a point of each voxel, in their order
        owner = owners(places[first, :3], goal.regions, MOVE_MARGIN_M)
        of_members = computed.of_members
        gradient = (torch.from_numpy(weights[:, owner]).to(of_members) * of_members).mean(0)
    return [gradient, *others]
