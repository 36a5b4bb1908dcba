"""The presets: `waymo` is OpenPCDet's centerpoint_without_resnet.yaml number by number, `small` is small."""

from __future__ import annotations

import torch

from advpipe.pipeline.detector.centerpoint.model import CenterPointNet
from advpipe.pipeline.detector.centerpoint.presets import SMALL, WAYMO
from advpipe.pipeline.geometry.boxes import CLASSES


def count(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def test_waymo_has_as_many_parameters_as_the_yaml_says():
    net = CenterPointNet(WAYMO)
    # SECOND's of KITTI, but for the fifth feature of a point in the first layer.
    assert (count(net.backbone3d), count(net.backbone2d)) == (711_872 + 27 * 16, 4_576_768)
    shared = 512 * 64 * 9 + 64 + 2 * 64
    hidden = 64 * 64 * 9 + 64 + 2 * 64
    last = [(64 * 9 + 1) * width for width in (2, 1, 3, 2, 3)]
    assert count(net.head) == shared + 5 * hidden + sum(last) == 486_731
    assert count(net) == 5_775_803


def test_waymo_has_the_numbers_of_its_yaml():
    assert WAYMO.grid_zyx == (41, 1504, 1504)
    assert (WAYMO.points_per_voxel, WAYMO.max_voxels) == (5, 150_000)
    assert (WAYMO.heat_overlap, WAYMO.least_radius, WAYMO.box_heat, WAYMO.axis_code) == (0.1, 2, 1.0, False)
    assert (WAYMO.nms_iou, WAYMO.max_candidates, WAYMO.max_detections) == (0.7, 500, 500)
    net = CenterPointNet(WAYMO)
    grid = net.centre_grid()
    assert (grid.height, grid.width, net.voxels_per_cell) == (188, 188, 8)
    torch.testing.assert_close(grid.cell_m, torch.tensor([0.8, 0.8]))


def test_small_fits_in_a_checkpoint_of_four_megabytes():
    assert SMALL.classes == CLASSES
    assert count(CenterPointNet(SMALL)) == 1_410_367
    assert 2 * count(CenterPointNet(SMALL)) < 4e6
