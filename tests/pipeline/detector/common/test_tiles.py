"""Tiles of a map against the whole map: exactly what they neglect, and how little that is."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
import torch
from torch import nn

from advpipe.pipeline.adversary.targets import find_targets
from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.detector.centerpoint.head import CentreHead
from advpipe.pipeline.detector.centerpoint.presets import SMALL as CENTRES
from advpipe.pipeline.detector.centerpoint.presets import CenterPointPreset
from advpipe.pipeline.detector.common import tiles
from advpipe.pipeline.detector.common.backbone2d import Backbone2d
from advpipe.pipeline.detector.common.head import Head
from advpipe.pipeline.detector.common.preset import BevBlock
from advpipe.pipeline.detector.common.tiles import OccupiedMap
from advpipe.pipeline.detector.protocol import LossInput, OccupancyLoss
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import KITTI, SMALL
from advpipe.pipeline.geometry.boxes import points_in_boxes
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.messages.cloud import xyzi

BLOCKS = (BevBlock(2, 1, 5, 1, 6), BevBlock(3, 2, 7, 2, 4), BevBlock(1, 2, 8, 4, 4))
FINE_BLOCKS = (BevBlock(1, 2, 5, 1, 0), BevBlock(1, 1, 7, 1, 4), BevBlock(1, 2, 8, 2, 4))
"""As PointPillars has them: predictions at cells of two of the map's, from the second block on."""

SIZE = (24, 36)


def layers_of(preset=SMALL, blocks=BLOCKS) -> tuple[Backbone2d, nn.Module]:
    torch.manual_seed(4)
    backbone = Backbone2d(blocks, 3)
    head = (CentreHead if isinstance(preset, CenterPointPreset) else Head)(preset, backbone.out_channels)
    for module in [*backbone.modules(), *head.modules()]:
        if isinstance(module, nn.BatchNorm2d):
            nn.init.uniform_(module.bias, -0.3, 0.5)
            nn.init.uniform_(module.running_mean, -0.2, 0.2)
        elif isinstance(module, nn.Conv2d) and module not in backbone.modules():
            nn.init.normal_(module.weight, std=0.1)
    return backbone.double().eval().requires_grad_(False), head.double().eval().requires_grad_(False)


def maps_of() -> tuple[torch.Tensor, torch.Tensor]:
    """Two maps: cells in a corner, at an edge, inside; and one cell that holds zeros."""
    torch.manual_seed(5)
    occupied = torch.zeros(2, *SIZE, dtype=torch.bool)
    occupied[0, 0, 0] = occupied[0, 22:, 30:] = occupied[1, 9:12, 17] = occupied[1, 9, 35] = True
    bev = torch.randn(2, 3, *SIZE, dtype=torch.float64) * occupied[:, None]
    bev[1, :, 9, 35] = 0
    return bev.to(memory_format=torch.channels_last), occupied


def by_hand(backbone: Backbone2d, head: nn.Module, bev: torch.Tensor, active: torch.Tensor) -> torch.Tensor:
    """Every layer on the whole map; what convolutions give outside of the tiles is that of an empty map."""
    empty: dict[nn.Conv2d, torch.Tensor] = {}

    def noted(layer: nn.Conv2d, x: torch.Tensor) -> torch.Tensor:
        empty[layer] = layer(x)
        return empty[layer].clone()

    def beside(layer: nn.Conv2d, x: torch.Tensor) -> torch.Tensor:
        out = layer(x)
        scale = SIZE[0] // out.shape[2]
        return torch.where(active[:, None, ::scale, ::scale], out, empty[layer])

    head(backbone(torch.zeros_like(bev), noted), noted)
    return all_of(head(backbone(bev, beside), beside))


def all_of(predictions) -> torch.Tensor:
    parts = (getattr(predictions, field.name) for field in fields(predictions))
    return torch.cat([part.flatten(1) for part in parts if part is not None], 1)


@pytest.mark.parametrize(
    ("preset", "blocks", "margin", "side"),
    [(SMALL, BLOCKS, 2, 4), (KITTI, BLOCKS, 2, 4), (CENTRES, BLOCKS, -1, 4), (SMALL, FINE_BLOCKS, 1, 2)],
    ids=["qualities", "anchors", "centres", "finer map"],
)
def test_tiles_lie_in_an_empty_map(preset, blocks, margin, side, monkeypatch):
    monkeypatch.setattr(tiles, "MARGIN_CELLS", margin)
    monkeypatch.setattr(tiles, "TILE_CELLS", side)  # the head of centres reaches three cells farther
    (backbone, head), (bev, occupied) = layers_of(preset, blocks), maps_of()
    rows, columns = (torch.arange(n) // 4 for n in SIZE)
    active = torch.zeros_like(occupied)
    for b, y, x in occupied.nonzero().tolist():
        near_rows = ((rows * 4 - 2 <= y) & (y < rows * 4 + 6))[:, None]
        active[b] |= near_rows & ((columns * 4 - 2 <= x) & (x < columns * 4 + 6))
    assert 0.1 < float(active.double().mean()) < 0.4
    leaf, same = bev.clone().requires_grad_(), bev.clone().requires_grad_()
    found = all_of(OccupiedMap(backbone, head)(leaf, occupied))
    wanted = by_hand(backbone, head, same, active)
    torch.testing.assert_close(found, wanted)
    weights = torch.randn_like(wanted)
    (gradient,) = torch.autograd.grad((found * weights).sum(), leaf)
    (expected,) = torch.autograd.grad((wanted * weights).sum(), same)
    torch.testing.assert_close(gradient * active[:, None], expected * active[:, None])
    assert gradient[1, :, 9, 35].all()  # an empty voxel that is probed has a gradient, too


def test_a_map_that_is_mostly_occupied_is_computed_whole():
    (backbone, head), (bev, occupied) = layers_of(), maps_of()
    whole = all_of(head(backbone(bev)))
    assert torch.equal(all_of(OccupiedMap(backbone, head)(bev, torch.ones_like(occupied))), whole)
    assert torch.equal(all_of(OccupiedMap(backbone, head)(bev, torch.zeros_like(occupied))), whole)


def test_the_maps_of_a_batch_are_computed_as_if_alone():
    (backbone, head), (bev, occupied) = layers_of(), maps_of()
    bev[1], occupied[1] = torch.randn_like(bev[1]), True
    kept = OccupiedMap(backbone, head)
    together = all_of(kept(bev, occupied))
    alone = [all_of(kept(bev[b : b + 1], occupied[b : b + 1])) for b in range(2)]
    torch.testing.assert_close(together, torch.cat(alone))
    torch.testing.assert_close(alone[1], all_of(head(backbone(bev[1:]))))
    assert (alone[0] - all_of(head(backbone(bev[:1])))).abs().max() > 1e-6  # in tiles


def test_a_map_that_is_no_whole_number_of_tiles_is_computed_whole():
    bev, occupied = (each[..., :26] for each in maps_of())
    backbone, head = Backbone2d(BLOCKS[:1], 3).double().eval(), Head(SMALL, 6).double()
    found = all_of(OccupiedMap(backbone, head)(bev, occupied))
    assert torch.equal(found, all_of(head(backbone(bev))))


def test_new_weights_and_numbers_renew_the_empty_map():
    (backbone, head), (bev, occupied) = layers_of(), maps_of()
    kept = OccupiedMap(backbone, head)
    before = all_of(kept(bev, occupied))
    with torch.no_grad():
        head.convolution.bias.add_(1)
    after = all_of(kept(bev, occupied))
    torch.testing.assert_close(after, before + 1)
    backbone.float(), head.float()
    single = all_of(kept(bev.float(), occupied))
    torch.testing.assert_close(single.double(), after, rtol=1e-4, atol=1e-4)


def test_the_empty_map_is_no_part_of_a_checkpoint():
    net = SecondNet(SMALL).eval()
    names = set(net.state_dict())
    occupied = torch.zeros(1, 32, 32)
    occupied[0, 3, 5] = 1
    net._occupied_map(torch.zeros(1, 128, 32, 32), occupied)
    assert net._occupied_map._empty is not None
    assert set(net.state_dict()) == names


def test_the_shipped_detector_sees_the_same_in_tiles(monkeypatch):
    """Loss, gradient and detections around two objects of a recorded cloud, with probe points, in a batch."""
    detector = load_detector("small")
    assert isinstance(detector, Second)
    (frame,) = read_frames(resolve_bag(shipped_sample() / "clean"), FrameSlice(1, 2, 1))
    targets, points = find_targets(detector, frame.cloud, frame.boxes), xyzi(frame.cloud)
    geometry = targets.boxes.double().numpy()
    by_count = np.argsort([-len(inside) for inside in points_in_boxes(points, geometry, 0.0)])[:2]
    shown = np.unique(np.concatenate(points_in_boxes(points, geometry[by_count], 5.0)))
    near = torch.from_numpy(points[shown])
    probes = near[::50] + torch.tensor([0.0, 0.0, 0.5, 0.0])
    given = [LossInput(near, targets.boxes, targets.labels, extra) for extra in (probes, None)]

    def computed() -> tuple[list[OccupancyLoss], list[np.ndarray]]:
        results = detector.occupancy_loss_batch(given)
        gradients = torch.autograd.grad([each.loss for each in results], [r.occupancy for r in results])
        return results, [gradient.numpy() for gradient in gradients]

    in_tiles, gradients = computed()
    assert detector.net._occupied_map._empty is not None
    monkeypatch.setattr(tiles, "MOST_TILES", 0)
    whole, expected = computed()
    for mine, theirs, gradient, wanted in zip(in_tiles, whole, gradients, expected, strict=True):
        assert float(mine.loss.detach()) == pytest.approx(float(theirs.loss.detach()), rel=0.005)
        assert np.corrcoef(gradient, wanted)[0, 1] > 0.997
        assert len(theirs.found) >= 2
        np.testing.assert_allclose(mine.found.scores, theirs.found.scores, atol=0.005)
        assert iou_3d(mine.found.boxes, theirs.found.boxes).max(axis=0).min() > 0.99
