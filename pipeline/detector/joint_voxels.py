"""Voxel occupancy of several detectors at once, whatever their grids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

from advpipe.pipeline.detector.protocol import OccupancyLoss


@dataclass(frozen=True)
class JointOccupancyLoss(OccupancyLoss):
    """The result of `joint_occupancy_loss`. of_members: (E, V), the gradients of the members' losses to the
    occupancy, of which that of the loss is the mean; zeros where none is wanted."""

    of_members: Tensor = field(default_factory=lambda: torch.zeros(0, 0))


def joint_occupancy_loss(computed: Sequence[OccupancyLoss], points: Tensor) -> JointOccupancyLoss:
    """What several detectors computed for the same points (N, 4) and probe points, as of one.

    Its voxels are the intersections of theirs: points share one where they share a voxel of every detector.
    The loss is the mean of theirs. Its gradient is the mean of their gradients, each brought to a mean
    absolute value of 1, as the scales of losses differ. The gradient of an occupied voxel is divided evenly
    among the occupied intersections in it; an empty intersection in a voxel that is occupied elsewhere gains
    nothing.
    """
    rows = torch.stack([each.rows for each in computed])
    read = (rows >= 0).any(0)
    joint = torch.zeros(int(read.sum()), dtype=torch.int64, device=rows.device)
    for row in rows[:, read]:
        most = int(row.max()) + 2 if len(row) else 1
        joint = torch.unique(joint * most + row + 1, return_inverse=True)[1]
    count = int(joint.max()) + 1 if len(joint) else 0
    row_of_cell = rows.new_full((len(rows), count), -1)
    row_of_cell[:, joint] = rows[:, read]
    cell = torch.full_like(rows[0], -1)
    cell[read] = joint
    held = torch.zeros(count, dtype=torch.bool, device=rows.device)
    held[cell[: len(points)][cell[: len(points)] >= 0]] = True
    occupancy = held.to(points.dtype).requires_grad_()
    loss = torch.stack([each.loss for each in computed]).mean()
    to_cells = occupancy.new_zeros(len(computed), count)
    if torch.is_grad_enabled() and loss.requires_grad:
        to_points = torch.zeros_like(points)
        for number, (each, row) in enumerate(zip(computed, row_of_cell, strict=True)):
            to_cells[number], of_points = _scaled_gradients(each, row, held, points)
            to_points += of_points / len(computed)
        loss = loss.detach() + ((occupancy - occupancy.detach()) * to_cells.mean(0)).sum()
        if points.requires_grad:
            loss = loss + ((points - points.detach()) * to_points).sum()
    return JointOccupancyLoss(loss, occupancy, cell, of_members=to_cells)


def _scaled_gradients(
    computed: OccupancyLoss, row: Tensor, held: Tensor, points: Tensor
) -> tuple[Tensor, Tensor]:
    """The gradients of one detector's loss to the intersections (V,), of which each lies in the voxel `row`,
    and to the points."""
    wanted = [computed.occupancy, *([points] if points.requires_grad else [])]
    to_voxels, *to_points = (
        torch.autograd.grad(computed.loss, wanted, allow_unused=True, materialize_grads=True)
        if computed.loss.requires_grad
        else [torch.zeros_like(each) for each in wanted]
    )
    known = row >= 0
    cells_held = torch.bincount(row[known & held], minlength=len(to_voxels))
    share = torch.where(held, 1 / cells_held[row].clamp(min=1), (cells_held[row] == 0).to(to_voxels.dtype))
    to_cells = torch.where(known, to_voxels[row] * share, 0.0)
    size = to_cells.abs().mean() if len(to_cells) else to_cells.new_zeros(())
    scale = 1 / size if size > 0 else torch.ones_like(size)
    return to_cells * scale, to_points[0] * scale if to_points else torch.zeros_like(points)
