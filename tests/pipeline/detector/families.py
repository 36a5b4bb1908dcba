"""Small networks of the families beside SECOND, with random weights."""

from __future__ import annotations

from dataclasses import replace

import torch
from batch_norms import draw_batch_norms

from advpipe.pipeline.detector.centerpoint.model import CenterPointNet
from advpipe.pipeline.detector.centerpoint.presets import SMALL as CENTRES
from advpipe.pipeline.detector.centerpoint.presets import WAYMO
from advpipe.pipeline.detector.common.voxel_detector import VoxelNetworkDetector
from advpipe.pipeline.detector.common.voxel_network import VoxelNetwork
from advpipe.pipeline.detector.pointpillars.model import PointPillarsNet
from advpipe.pipeline.detector.pointpillars.presets import KITTI
from advpipe.pipeline.detector.pointpillars.presets import SMALL as PILLARS
from advpipe.pipeline.detector.protocol import Range

NETWORKS = {
    "pointpillars": (PointPillarsNet, PILLARS),
    "pointpillars-kitti": (PointPillarsNet, KITTI),
    "centerpoint": (CenterPointNet, CENTRES),
    "centerpoint-waymo": (CenterPointNet, WAYMO),
}
HALF_M = 6.4


def small_network(name: str) -> VoxelNetwork:
    """The network of a preset over an eighth of the width of `small`; its batch norms have seen something."""
    build, preset = NETWORKS[name]
    r = preset.range_m
    torch.manual_seed(5)
    net = build(replace(preset, range_m=Range(-HALF_M, -HALF_M, r.z_min_m, HALF_M, HALF_M, r.z_max_m)))
    draw_batch_norms(net)
    for module in net.head.modules():
        if isinstance(module, torch.nn.Conv2d):
            torch.nn.init.normal_(module.weight, std=0.1 if module.kernel_size == (3, 3) else 0.4)
    for place, weight in net.head.named_parameters():
        if "center_z" in place and weight.ndim == 4:
            torch.nn.init.normal_(weight, std=0.02)  # so that boxes lie in the range
    return net


def small_detector(name: str) -> VoxelNetworkDetector:
    return VoxelNetworkDetector(small_network(name))
