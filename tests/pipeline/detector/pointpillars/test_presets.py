"""The presets: `kitti` is OpenPCDet's pointpillar.yaml number by number, `small` is small."""

from __future__ import annotations

import torch

from advpipe.pipeline.detector.pointpillars.model import PointPillarsNet
from advpipe.pipeline.detector.pointpillars.presets import KITTI, SMALL
from advpipe.pipeline.geometry.boxes import CLASSES


def count(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def convolutions(c_in: int, channels: int, layers: int) -> int:
    """A 3 x 3 layer from c_in, and the others from channels; a scale and a shift each."""
    return 9 * c_in * channels + 9 * channels**2 * (layers - 1) + 2 * channels * layers


def test_kitti_has_as_many_parameters_as_the_yaml_says():
    net = PointPillarsNet(KITTI)
    # NUM_FILTERS [64] of 4 + 6 features; LAYER_NUMS [3, 5, 5] behind the first of each block.
    assert count(net.encoder) == 10 * 64 + 2 * 64
    blocks = convolutions(64, 64, 4) + convolutions(64, 128, 6) + convolutions(128, 256, 6)
    ups = 64 * 128 + 128 * 128 * 4 + 256 * 128 * 16 + 3 * 2 * 128
    assert count(net.backbone2d) == blocks + ups
    # 3 classes x 2 rotations: 3 scores, 7 numbers of a box and 2 directions at each.
    assert count(net.head) == (384 + 1) * 6 * (3 + 7 + 2)
    assert count(net) == 4_834_888


def test_kitti_has_the_numbers_of_pointpillar_yaml():
    assert KITTI.grid_zyx == (1, 496, 432)
    assert (KITTI.points_per_voxel, KITTI.max_voxels, KITTI.max_voxels_training) == (32, 40_000, 16_000)
    assert (KITTI.nms_iou, KITTI.max_candidates, KITTI.max_detections) == (0.01, 4096, 500)
    grid = PointPillarsNet(KITTI).anchor_grid()
    assert (grid.height, grid.width, grid.per_cell) == (248, 216, 6)
    ends = grid.boxes(torch.tensor([0, 248 * 216 * 6 - 1]))
    expected = [
        [0.0, -39.68, -1.78 + 0.78, 3.9, 1.6, 1.56, 0.0],
        [69.12, 39.68, -0.6 + 0.865, 1.76, 0.6, 1.73, 1.57],
    ]
    torch.testing.assert_close(ends, torch.tensor(expected))


def test_small_fits_in_a_checkpoint_of_four_megabytes():
    net = PointPillarsNet(SMALL)
    assert SMALL.classes == CLASSES
    assert 2 * count(net) < 4e6
    assert (SMALL.grid_zyx, net.voxels_per_cell) == ((1, 640, 640), 4)
