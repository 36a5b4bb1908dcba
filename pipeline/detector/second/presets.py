"""Sizes of SECOND: one frozen preset for each network that a checkpoint can hold."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.detector.common.preset import Anchor, AnchorVoxelPreset, BevBlock, SparsePreset
from advpipe.pipeline.detector.expected_input import ExpectedInput
from advpipe.pipeline.detector.protocol import Range


@dataclass(frozen=True, kw_only=True)
class SecondPreset(AnchorVoxelPreset, SparsePreset):
    """The shape of a SECOND; `kitti`, whose weights were trained with OpenPCDet, needs its own limits."""

    family = "second"


SMALL = SecondPreset(
    name="small",
    # From 0.4 m higher or lower, or tilted by 2 degrees, ground and trucks' roofs are in range everywhere.
    # Strides leave two of so many layers, and no layer of voxels is without an effect.
    range_m=Range(-51.2, -51.2, -4.35, 51.2, 51.2, 3.03),
    voxel_size_m=(0.1, 0.1, 0.18),
    expected_input=ExpectedInput(lidar_height_m=1.8, tolerated_m=0.4, tolerated_rad=0.035),
    channels_3d=(16, 16, 16, 32, 64, 64),
    bev=(BevBlock(4, 1, 64, 1, 128), BevBlock(4, 2, 128, 2, 128)),
    anchors=(
        Anchor("car", 4.2, 1.8, 1.55, -1.8, 0.6, 0.45),
        Anchor("truck", 5.4, 2.05, 2.3, -1.8, 0.6, 0.45),
        Anchor("truck", 10.0, 2.5, 3.2, -1.8, 0.55, 0.4),
        Anchor("truck", 16.5, 2.55, 4.0, -1.8, 0.55, 0.4),
        Anchor("cyclist", 1.9, 0.75, 1.7, -1.8, 0.45, 0.3),
        Anchor("pedestrian", 0.8, 0.7, 1.75, -1.8, 0.4, 0.25),
    ),
    # Coordinates of magnitude one train faster; height counted from the bottom also encodes "occupied".
    input_offset=(0.0, 0.0, -4.35, 0.0),
    input_scale=(1 / 51.2, 1 / 51.2, 0.4, 1.0),
    place_in_voxel=True,
    overlap_weight=0.5,
    nms_iou=0.5,
    vote_iou=0.6,
    suppress_by_class=True,
    quality_power=2.0,
)
"""All around a roof LiDAR about 1.8 m above the road; 1.39 M parameters; trains on two CPU cores."""

ALL_AROUND = SecondPreset(
    name="360",
    range_m=Range(-51.2, -51.2, -4.2, 51.2, 51.2, 2.85),
    voxel_size_m=(0.1, 0.1, 0.15),
    expected_input=ExpectedInput(lidar_height_m=1.8),
    channels_3d=(16, 16, 32, 64, 64, 128),
    bev=(BevBlock(5, 1, 128, 1, 256), BevBlock(5, 2, 256, 2, 256)),
    anchors=SMALL.anchors,
    input_offset=SMALL.input_offset,
    input_scale=SMALL.input_scale,
    place_in_voxel=True,
    overlap_weight=0.5,
    nms_iou=0.5,
    vote_iou=0.6,
    suppress_by_class=True,
    quality_power=2.0,
)
"""`small` with the channels and layers of `kitti` and finer voxels along z; 5.37 M parameters."""

KITTI = SecondPreset(
    name="kitti",
    range_m=Range(0.0, -40.0, -3.0, 70.4, 40.0, 1.0),
    voxel_size_m=(0.05, 0.05, 0.1),
    expected_input=ExpectedInput(lidar_height_m=1.73),
    channels_3d=(16, 16, 32, 64, 64, 128),
    bev=(BevBlock(5, 1, 128, 1, 256), BevBlock(5, 2, 256, 2, 256)),
    classes=("car", "pedestrian", "cyclist"),
    anchors=(
        Anchor("car", 3.9, 1.6, 1.56, -1.78, 0.6, 0.45),
        Anchor("pedestrian", 0.8, 0.6, 1.73, -0.6, 0.5, 0.35),
        Anchor("cyclist", 1.76, 0.6, 1.73, -0.6, 0.5, 0.35),
    ),
    yaws_rad=(0.0, 1.57),
    direction_offset_rad=0.78539,
    layers_above=1,
    points_per_voxel=5,
    max_voxels=40_000,
    max_voxels_training=16_000,
    anchors_to_edges=True,
    nms_iou=0.01,
    max_candidates=4096,
    max_detections=500,
)
"""OpenPCDet's `second.yaml` for KITTI, number by number: 5,325,576 parameters, for imported weights.

It covers only the front. Its LiDAR is 1.73 m above the road, and coordinates are not normalised:
`--lidar-height` or `--level` present a cloud from another height. In training, points outside the camera's
view were removed, and intensity is KITTI's reflectance in [0, 1].
"""

PRESETS = {"small": SMALL, "360": ALL_AROUND, "kitti": KITTI}
