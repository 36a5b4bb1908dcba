"""What the centre head is to learn: a heat map of each class, and the box at each object's centre."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import torch
from torch import Tensor

from advpipe.pipeline.bag.uncounted import Uncounted
from advpipe.pipeline.detector.centerpoint.presets import CenterPointPreset

LARGEST_LOG = 5.0
"""A predicted size is at most e^5 m either way: a network that was never trained may predict any."""


@dataclass(frozen=True)
class CentreTargets:
    """The training targets of one cloud on N cells.

    heat: (N, classes), 1 at the centre of an object and less about it. counted: (N, classes) bool; the
    others do not contribute to the loss. cells: (K,) int64, those that learn a box; boxes: (K, 7); labels:
    (K,); weights: (K,), the heat of that box there, 1 at its centre.
    """

    heat: Tensor
    counted: Tensor
    cells: Tensor
    boxes: Tensor
    labels: Tensor
    weights: Tensor


class CentreGrid:
    """The (H, W) cells of the head's map."""

    def __init__(
        self, preset: CenterPointPreset, height: int, width: int, device: torch.device | None = None
    ) -> None:
        self.preset, self.height, self.width = preset, height, width
        r = preset.range_m
        self.low_m = torch.tensor([r.x_min_m, r.y_min_m], device=device)
        high_m = torch.tensor([r.x_max_m, r.y_max_m], device=device)
        self.cell_m = (high_m - self.low_m) / torch.tensor([width, height], device=device)

    @torch.no_grad()
    def assign(
        self,
        boxes: Tensor,
        labels: Tensor,
        ignored: Tensor | None = None,
        uncounted: Uncounted | None = None,
    ) -> CentreTargets:
        """Targets for boxes (M, 7) and labels (M,); boxes in the mask `ignored` (M,) are not learned.

        About an ignored box, where its peak would be, its class does not count; about an object of
        `uncounted`, and in its regions, no class does.
        """
        r, classes = self.preset.range_m, len(self.preset.classes)
        inside = (boxes[:, 0] >= r.x_min_m) & (boxes[:, 0] < r.x_max_m)
        inside &= (boxes[:, 1] >= r.y_min_m) & (boxes[:, 1] < r.y_max_m)
        is_learned = inside if ignored is None else inside & ~ignored
        peaks = self._peaks(boxes)
        heat = peaks.new_zeros(classes, self.height, self.width)
        counted = torch.ones_like(heat, dtype=torch.bool)
        for label in range(classes):
            mine = labels == label
            if (learned := mine & is_learned).any():
                heat[label] = peaks[learned].amax(0)
            if (others := mine & inside & ~is_learned).any():
                counted[label] = peaks[others].amax(0) == 0
        if uncounted:
            counted &= ~self._uncounted(uncounted)
        counted |= heat == 1
        own = peaks[is_learned].flatten(1)
        # Where peaks overlap, a cell learns the box of the highest.
        takes = (own >= self.preset.box_heat) & (own == heat.flatten(1).amax(0))
        objects, cells = takes.nonzero().unbind(1)
        return CentreTargets(
            heat.flatten(1).T,
            counted.flatten(1).T,
            cells,
            boxes[is_learned][objects],
            labels[is_learned][objects],
            own[takes],
        )

    def places(self, boxes: Tensor) -> Tensor:
        """The centres (M, 2) of boxes (M, 7) in cells along x and y, on the map."""
        places = (boxes[:, :2] - self.low_m) / self.cell_m
        return torch.minimum(places.clamp(min=0), places.new_tensor([self.width, self.height]) - 0.5)

    def encode(self, boxes: Tensor, cells: Tensor) -> Tensor:
        """The code (K, C) of boxes (K, 7) at flat cells (K,).

        The centre from the cell's corner along x and y in cells, z in metres, the logarithms of length, width
        and height in metres, cosine and sine of the heading; with `axis_code` also of twice the heading.
        """
        offsets, yaw = self.places(boxes) - self._corners(cells), boxes[:, 6:7]
        turns = [yaw, 2 * yaw] if self.preset.axis_code else [yaw]
        waves = [wave(turn) for turn in turns for wave in (torch.cos, torch.sin)]
        return torch.cat([offsets, boxes[:, 2:3], torch.log(boxes[:, 3:6]), *waves], dim=1)

    def decode(self, code: Tensor, cells: Tensor) -> Tensor:
        """The boxes (K, 7) of a code (K, C) at flat cells (K,)."""
        centre = (self._corners(cells) + code[:, :2]) * self.cell_m + self.low_m
        size = torch.exp(code[:, 3:6].clamp(-LARGEST_LOG, LARGEST_LOG))
        yaw = torch.atan2(code[:, 7], code[:, 6])
        if self.preset.axis_code:
            axis = torch.atan2(code[:, 9], code[:, 8]) / 2
            is_ahead = code[:, 6] * torch.cos(axis) + code[:, 7] * torch.sin(axis) >= 0
            yaw = torch.where(is_ahead, axis, axis + pi)
        return torch.cat([centre, code[:, 2:3], size, yaw[:, None]], dim=1)

    def _corners(self, cells: Tensor) -> Tensor:
        """Column and row (K, 2) of flat cells (K,)."""
        return torch.stack([cells % self.width, cells // self.width], dim=1)

    def _peaks(self, boxes: Tensor) -> Tensor:
        """The heat (M, H, W) about each box: a Gaussian in a square of its radius, 1 in the centre's cell."""
        sizes = boxes[:, 3:5] / self.cell_m
        radius = peak_radius(sizes, self.preset.heat_overlap).floor()
        radius = radius.clamp(min=self.preset.least_radius)[:, None]
        centre = self.places(boxes).floor()

        def along(count: int, middle: Tensor) -> Tensor:
            away = torch.arange(count, device=boxes.device, dtype=boxes.dtype) - middle[:, None]
            deviation = (2 * radius + 1) / 6
            return torch.exp(-(away**2) / (2 * deviation**2)) * (away.abs() <= radius)

        return along(self.height, centre[:, 1])[:, :, None] * along(self.width, centre[:, 0])[:, None]

    def _uncounted(self, uncounted: Uncounted) -> Tensor:
        """Which cells (H, W) lie where nothing counts, or about an object that does not."""
        r, device = self.preset.range_m, self.low_m.device
        cells = torch.arange(self.height * self.width, device=device)
        centres = torch.zeros(len(cells), 7, device=device)
        centres[:, :2] = (self._corners(cells) + 0.5) * self.cell_m + self.low_m
        centres[:, 2] = (r.z_min_m + r.z_max_m) / 2
        found = uncounted.ignores_centres(centres.cpu().double().numpy())
        outside = torch.from_numpy(found).to(device).view(self.height, self.width)
        if len(uncounted.boxes):
            objects = torch.from_numpy(uncounted.boxes.geometry).to(self.low_m)
            outside |= (self._peaks(objects) > 0).any(0)
        return outside


def peak_radius(sizes: Tensor, overlap: float) -> Tensor:
    """How far (M,) in cells a box of these lengths and widths (M, 2), in cells, may be off along both axes.

    The least of three radii, one each for a box that is moved, smaller and larger and still has that IoU with
    the true one (Law and Deng 2018, "CornerNet", section 3.2); each is the larger root of the quadratic as
    OpenPCDet has it, whose leading coefficient does not divide.
    """
    total, area = sizes.sum(1), sizes.prod(1)
    roots = []
    for a, b, c in (
        (1.0, total, area * (1 - overlap) / (1 + overlap)),
        (4.0, 2 * total, (1 - overlap) * area),
        (4 * overlap, -2 * overlap * total, (overlap - 1) * area),
    ):
        roots.append((b + torch.sqrt(b**2 - 4 * a * c)) / 2)
    return torch.stack(roots).amin(0)
