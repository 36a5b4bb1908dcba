"""Sizes of PointPillars: one frozen preset for each network that a checkpoint can hold."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.detector.common.preset import AnchorVoxelPreset, BevBlock
from advpipe.pipeline.detector.expected_input import ExpectedInput
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.second.presets import KITTI as SECOND_KITTI
from advpipe.pipeline.detector.second.presets import SMALL as SECOND_SMALL

Row = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class PointPillarsPreset(AnchorVoxelPreset):
    """The shape of a PointPillars; its voxels reach over the whole height of the range.

    channels: of a pillar. input_offset, input_scale: x, y, z, intensity of a point enter the network as
    (value - offset) * scale. from_mean_scale, from_centre_scale: factors of its offsets x, y, z from the mean
    of its pillar's points, and from the pillar's centre.
    """

    family = "pointpillars"

    channels: int
    input_offset: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    input_scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    from_mean_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    from_centre_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


SMALL = PointPillarsPreset(
    name="small",
    range_m=SECOND_SMALL.range_m,
    voxel_size_m=(0.16, 0.16, 7.38),
    expected_input=SECOND_SMALL.expected_input,
    channels=32,
    # The head reads no block finer than 0.64 m; its anchors are those of SECOND's `small`.
    bev=(BevBlock(2, 2, 32, 1, 0), BevBlock(4, 2, 64, 1, 128), BevBlock(4, 2, 128, 2, 128)),
    anchors=SECOND_SMALL.anchors,
    # Height counts most, as no voxel's place tells it: from the ground to the roof of a car it is about one
    # either way. Offsets within a pillar are about in metres, as OpenPCDet has them.
    input_offset=(0.0, 0.0, -1.0, 0.0),
    input_scale=(1 / 51.2, 1 / 51.2, 2.0, 1.0),
    from_mean_scale=(1.25, 1.25, 2.0),
    from_centre_scale=(1.25, 1.25, 0.4),
    overlap_weight=0.5,
    vote_iou=0.5,
    suppress_by_class=True,
    quality_power=1.0,
)
"""All around a roof LiDAR about 1.8 m above the road; trains on two CPU cores."""

KITTI = PointPillarsPreset(
    name="kitti",
    range_m=Range(0.0, -39.68, -3.0, 69.12, 39.68, 1.0),
    voxel_size_m=(0.16, 0.16, 4.0),
    expected_input=ExpectedInput(lidar_height_m=1.73),
    channels=64,
    bev=(BevBlock(3, 2, 64, 1, 128), BevBlock(5, 2, 128, 2, 128), BevBlock(5, 2, 256, 4, 128)),
    classes=("car", "pedestrian", "cyclist"),
    anchors=SECOND_KITTI.anchors,
    yaws_rad=SECOND_KITTI.yaws_rad,
    direction_offset_rad=SECOND_KITTI.direction_offset_rad,
    points_per_voxel=32,
    max_voxels=40_000,
    max_voxels_training=16_000,
    anchors_to_edges=True,
    nms_iou=0.01,
    max_candidates=4096,
    max_detections=500,
)
"""OpenPCDet's `pointpillar.yaml` for KITTI, number by number: 4,834,888 parameters, for imported weights.

It covers only the front; its clouds are those of SECOND's preset of that name.
"""

PRESETS = {"small": SMALL, "kitti": KITTI}
