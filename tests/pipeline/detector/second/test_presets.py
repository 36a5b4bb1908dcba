"""The presets: `kitti` is OpenPCDet's second.yaml number by number, `360` trains."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.detector.common.anchors import AnchorGrid, decode_boxes, encode_boxes
from advpipe.pipeline.detector.common.loss import losses
from advpipe.pipeline.detector.common.voxels import voxelise
from advpipe.pipeline.detector.families import family_named
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import ALL_AROUND, KITTI, PRESETS
from advpipe.pipeline.geometry.boxes import CLASSES


def count(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def test_kitti_has_as_many_parameters_as_openpcdets_network():
    net = SecondNet(KITTI)
    assert (count(net.backbone3d), count(net.backbone2d), count(net.head)) == (711_872, 4_576_768, 36_936)
    assert count(net) == 5_325_576


def test_kitti_has_the_numbers_of_second_yaml():
    assert KITTI.grid_zyx == (41, 1600, 1408)
    assert (KITTI.points_per_voxel, KITTI.max_voxels, KITTI.max_voxels_training) == (5, 40_000, 16_000)
    assert (KITTI.nms_iou, KITTI.max_candidates, KITTI.max_detections) == (0.01, 4096, 500)
    assert KITTI.vote_iou is None
    grid = SecondNet(KITTI).anchor_grid()
    assert (grid.height, grid.width, grid.per_cell) == (200, 176, 6)
    assert grid.height * grid.width * grid.per_cell == 211_200
    # The anchors reach from face to face of the range: OpenPCDet does not centre them in their cells.
    ends = grid.boxes(torch.tensor([0, 1, 211_199]))
    expected = [
        [0.0, -40.0, -1.78 + 0.78, 3.9, 1.6, 1.56, 0.0],
        [0.0, -40.0, -1.78 + 0.78, 3.9, 1.6, 1.56, 1.57],
        [70.4, 40.0, -0.6 + 0.865, 1.76, 0.6, 1.73, 1.57],
    ]
    torch.testing.assert_close(ends, torch.tensor(expected))
    assert grid.labels.tolist() == [0, 0, 1, 1, 2, 2]
    assert grid.positive_iou.tolist() == pytest.approx([0.6, 0.6, 0.5, 0.5, 0.5, 0.5])
    assert grid.negative_iou.tolist() == pytest.approx([0.45, 0.45, 0.35, 0.35, 0.35, 0.35])


def test_residual_code_equals_one_computed_by_hand():
    # Diagonal of the anchor 5 m: a box 1 m ahead of a 4 m x 3 m x 2 m anchor codes as 0.2.
    anchor = torch.tensor([[10.0, 0.0, -1.0, 4.0, 3.0, 2.0, 1.57]])
    box = torch.tensor([[11.0, -2.0, -0.5, 8.0, 3.0, 1.0, 1.0]])
    code = torch.tensor([[0.2, -0.4, 0.25, 0.6931472, 0.0, -0.6931472, -0.57]])
    torch.testing.assert_close(encode_boxes(box, anchor), code)
    torch.testing.assert_close(decode_boxes(code, anchor), box)


def test_360_is_kitti_in_size_with_our_classes():
    assert ALL_AROUND.classes == CLASSES
    assert count(SecondNet(ALL_AROUND)) == pytest.approx(5.3e6, rel=0.02)
    assert SecondNet(ALL_AROUND).backbone3d.out_channels == 256


@pytest.mark.parametrize(
    "name", [name if name == "small" else pytest.param(name, marks=pytest.mark.nightly) for name in PRESETS]
)
def test_a_network_of_each_preset_can_be_trained(name):
    """On a range of 128 x 128 voxels, forty steps on one scene at least halve the loss."""
    torch.manual_seed(0)
    preset = PRESETS[name]
    reach = 64 * preset.voxel_size_m[0]
    near = replace(preset.range_m, x_min_m=-reach, x_max_m=reach, y_min_m=-reach, y_max_m=reach)
    preset = replace(preset, range_m=near)
    net = SecondNet(preset)
    grid = AnchorGrid(preset, 16, 16)
    ground = (torch.rand(1500, 4) - 0.5) * torch.tensor([2 * reach, 2 * reach, 0.05, 1.0])
    ground -= torch.tensor([0.0, 0.0, 1.75, -0.5])
    car = torch.rand(200, 4) * torch.tensor([3.9, 1.6, 1.5, 1.0]) - torch.tensor([2.0, 0.8, 1.7, 0.0])
    boxes, labels = torch.tensor([[0.0, 0.0, -0.95, 3.9, 1.6, 1.5, 0.0]]), torch.tensor([0])
    voxels = voxelise([torch.cat([car, ground])], preset, training=True)
    optimiser = torch.optim.AdamW(net.parameters(), lr=3e-3)
    history = []
    for _ in range(40):
        loss = losses(net(voxels), [grid.assign(boxes, labels)], grid).total
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        history.append(float(loss.detach()))
    assert history[-1] < history[0] / 2
    assert len(Second(net).detect_batch([torch.cat([car, ground])])) == 1


def test_unknown_presets_are_refused():
    with pytest.raises(AdvpipeError, match="unknown detector preset 'big'; known: small, 360, kitti"):
        family_named("second").preset("big")
