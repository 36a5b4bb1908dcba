"""Anchors of the head, box coding relative to an anchor, and the assignment of targets to anchors."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import torch
from torch import Tensor
from torch.nn import functional as F

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.detector.common.preset import AnchorPreset


@dataclass(frozen=True)
class Targets:
    """The training targets of the N anchors of one cloud; all anchors that are neither positive nor ignored
    are background.

    positive: (P,) int64 anchors. boxes: (P, 7) and labels: (P,) of the target of each.
    ignored: (I,) int64 anchors that do not contribute to the loss.
    """

    positive: Tensor
    boxes: Tensor
    labels: Tensor
    ignored: Tensor


class AnchorGrid:
    """All anchors of a preset: at each cell of the (H, W) map, each anchor size at each yaw."""

    def __init__(
        self, preset: AnchorPreset, height: int, width: int, device: torch.device | None = None
    ) -> None:
        self.preset, self.height, self.width = preset, height, width
        r = preset.range_m
        gaps, first = (1, 0.0) if preset.anchors_to_edges else (0, 0.5)
        step_x, step_y = (r.x_max_m - r.x_min_m) / (width - gaps), (r.y_max_m - r.y_min_m) / (height - gaps)
        self.x = r.x_min_m + step_x * (torch.arange(width, device=device) + first)
        self.y = r.y_min_m + step_y * (torch.arange(height, device=device) + first)
        shapes, labels = [], []
        for anchor in preset.anchors:
            size = (anchor.length_m, anchor.width_m, anchor.height_m)
            for yaw in preset.yaws_rad:
                shapes.append([anchor.bottom_z_m + anchor.height_m / 2, *size, yaw])
                labels.append(preset.classes.index(anchor.class_name))
        self.shapes = torch.tensor(shapes, device=device)
        self.labels = torch.tensor(labels, device=device)
        yaws = len(preset.yaws_rad)
        positive = [anchor.positive_iou for anchor in preset.anchors for _ in range(yaws)]
        negative = [anchor.negative_iou for anchor in preset.anchors for _ in range(yaws)]
        self.positive_iou = torch.tensor(positive, device=device)
        self.negative_iou = torch.tensor(negative, device=device)

    @property
    def per_cell(self) -> int:
        """The number of anchors in each cell."""
        return len(self.shapes)

    def boxes(self, indices: Tensor) -> Tensor:
        """The anchors (K, 7) at flat indices (K,) into (H, W, A)."""
        shape = indices % self.per_cell
        cell = indices // self.per_cell
        xy = torch.stack([self.x[cell % self.width], self.y[cell // self.width]], dim=1)
        return torch.cat([xy, self.shapes[shape]], dim=1)

    @torch.no_grad()
    def assign(
        self,
        boxes: Tensor,
        labels: Tensor,
        ignored: Tensor | None = None,
        uncounted: Uncounted | None = None,
    ) -> Targets:
        """Targets for boxes (M, 7) and labels (M,); boxes in the mask `ignored` (M,) are not learned.

        The rules are those of OpenPCDet's AxisAlignedTargetAssigner. Within a class, the IoU of an anchor and
        a box is computed for their nearest axis-aligned rectangles. An anchor is positive from `positive_iou`
        on, and so are the best anchors of each box, whatever their IoU; an anchor between both thresholds is
        ignored. The anchors of an ignored box are ignored, too, instead of being background, and so are those
        on objects or in regions of `uncounted`, where nobody knows what is background.
        """
        r = self.preset.range_m
        inside = (boxes[:, 0] >= r.x_min_m) & (boxes[:, 0] < r.x_max_m)
        inside &= (boxes[:, 1] >= r.y_min_m) & (boxes[:, 1] < r.y_max_m)
        is_learned = inside if ignored is None else inside & ~ignored
        positive, matched, skipped = [], [], []
        for label in range(len(self.preset.classes)):
            shapes = (self.labels == label).nonzero().squeeze(1)
            of_class = (inside & (labels == label)).nonzero().squeeze(1)
            if len(shapes) == 0 or len(of_class) == 0:
                continue
            count = self.height * self.width * len(shapes)
            low, high = (
                iou[shapes].repeat(count // len(shapes)) for iou in (self.negative_iou, self.positive_iou)
            )
            cells = torch.arange(self.height * self.width, device=boxes.device) * self.per_cell
            flat = (cells[:, None] + shapes).flatten()
            box, at, iou = self._overlaps(boxes[of_class], shapes)
            grey = torch.zeros(count, dtype=torch.bool, device=boxes.device)
            grey[at[iou >= low[at]]] = True
            learned = is_learned[of_class[box]]
            box, at, iou = box[learned], at[learned], iou[learned]
            if len(box):
                best = iou.new_zeros(count).scatter_reduce(0, at, iou, "amax")
                best_of_box = iou.new_zeros(len(of_class)).scatter_reduce(0, box, iou, "amax")
                chosen = best >= high
                chosen[at[iou == best_of_box[box]]] = True
                grey &= ~chosen
                rows = chosen.nonzero().squeeze(1)
                is_best = iou == best[at]
                first = box.new_full((count,), len(of_class))
                first = first.scatter_reduce(0, at[is_best], box[is_best], "amin")
                positive.append(flat[rows])
                matched.append(of_class[first[rows]])
            skipped.append(flat[grey])
        none = labels.new_zeros(0)
        if uncounted:
            outside = self._uncounted(uncounted)
            outside[torch.cat([*positive, none])] = False
            skipped.append(outside.nonzero().squeeze(1))
        match = torch.cat([*matched, none])
        return Targets(torch.cat([*positive, none]), boxes[match], labels[match], torch.cat([*skipped, none]))

    def _uncounted(self, uncounted: Uncounted) -> Tensor:
        """Which anchors (H W A,) are centred where nothing counts, or lie on an object that does not."""
        anchors = self.boxes(torch.arange(self.height * self.width * self.per_cell, device=self.x.device))
        found = torch.from_numpy(uncounted.ignores_centres(anchors.cpu().double().numpy())).to(self.x.device)
        if len(uncounted.boxes):
            objects = torch.from_numpy(uncounted.boxes.geometry).to(self.shapes)
            _, at, iou = self._overlaps(objects, torch.arange(self.per_cell, device=self.x.device))
            found[at[iou >= self.negative_iou[at % self.per_cell]]] = True
        return found

    def _overlaps(self, boxes: Tensor, shapes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """All anchors of these shapes (S,) whose nearest axis-aligned rectangles touch those of boxes (M, 7).

        The box, the flat index into (H, W, S), and the IoU, (K,) each.
        """
        x_length, y_length = _extents(boxes[:, 3:5], boxes[:, 6])
        x_anchor, y_anchor = _extents(self.shapes[shapes, 1:3], self.shapes[shapes, 4])
        column, x = _near_cells(boxes[:, 0], x_length, self.x, x_anchor)
        row, y = _near_cells(boxes[:, 1], y_length, self.y, y_anchor)
        common = y[:, :, None] * x[:, None]
        union = (x_length * y_length)[:, None, None, None] + x_anchor * y_anchor - common
        touching = (common > 0).nonzero(as_tuple=True)
        box, i, j, shape = touching
        at = (row[box, i] * self.width + column[box, j]) * len(shapes) + shape
        return box, at, (common / union)[touching]


def _extents(size: Tensor, yaw: Tensor) -> tuple[Tensor, Tensor]:
    """Lengths along x and y of rectangles (M, 2) turned to the nearest right angle."""
    across = torch.remainder(yaw + pi / 4, pi) > pi / 2
    return torch.where(across, size[:, 1], size[:, 0]), torch.where(across, size[:, 0], size[:, 1])


def _near_cells(
    centre: Tensor, length: Tensor, cells: Tensor, anchor_length: Tensor
) -> tuple[Tensor, Tensor]:
    """The cells (M, n) about intervals (M,) whose anchor intervals (S,) may overlap them, and the common
    lengths (M, n, S) with those, 0 for cells beyond the first and last. cells: their places, equally far
    apart."""
    reach = (length + anchor_length.amax()) / 2
    first = torch.searchsorted(cells, centre - reach) - 1
    last = torch.searchsorted(cells, centre + reach)
    most = int((last - first).amax()) + 1 if len(centre) else 0
    near = first[:, None] + torch.arange(most, device=cells.device)
    is_cell = (near >= 0) & (near < len(cells))
    near = near.clamp(0, len(cells) - 1)
    places = cells[near][:, :, None]
    low = torch.maximum((centre - length / 2)[:, None, None], places - anchor_length / 2)
    high = torch.minimum((centre + length / 2)[:, None, None], places + anchor_length / 2)
    return near, (high - low).clamp(min=0) * is_cell[:, :, None]


def encode_boxes(boxes: Tensor, anchors: Tensor) -> Tensor:
    """The code (K, 7) of boxes (K, 7) relative to anchors (K, 7) (Yan et al. 2018, section 3.2.2)."""
    diagonal = torch.hypot(anchors[:, 3], anchors[:, 4])
    scale = torch.stack([diagonal, diagonal, anchors[:, 5]], dim=1)
    return torch.cat(
        [
            (boxes[:, :3] - anchors[:, :3]) / scale,
            torch.log(boxes[:, 3:6] / anchors[:, 3:6]),
            boxes[:, 6:] - anchors[:, 6:],
        ],
        dim=1,
    )


def decode_boxes(code: Tensor, anchors: Tensor) -> Tensor:
    """The boxes (K, 7) of a code (K, 7); the inverse of `encode_boxes`."""
    diagonal = torch.hypot(anchors[:, 3], anchors[:, 4])
    scale = torch.stack([diagonal, diagonal, anchors[:, 5]], dim=1)
    return torch.cat(
        [
            code[:, :3] * scale + anchors[:, :3],
            torch.exp(F.hardtanh(code[:, 3:6], -3.0, 3.0)) * anchors[:, 3:6],
            code[:, 6:] + anchors[:, 6:],
        ],
        dim=1,
    )
