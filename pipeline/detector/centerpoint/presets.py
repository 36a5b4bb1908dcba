"""Sizes of CenterPoint: one frozen preset for each network that a checkpoint can hold."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.detector.common.preset import BevBlock, SparsePreset, SuppressionPreset
from advpipe.pipeline.detector.expected_input import ExpectedInput
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.detector.second.presets import SMALL as SECOND_SMALL


@dataclass(frozen=True, kw_only=True)
class CenterPointPreset(SuppressionPreset, SparsePreset):
    """The shape of a CenterPoint, and the targets of its heat map.

    head_channels: of the layers of the head. heat_overlap: a box that is off by the radius of a target's peak
    still overlaps the true one by this IoU. least_radius: of a peak, in cells. box_heat: the heat from which
    a cell learns an object's box; 1 for the cell of the centre alone. axis_code: the head also predicts
    the cosine and the sine of twice the heading, and those of the heading itself only decide which end is the
    front: where that is in doubt, they shrink, and say little of the axis.
    """

    family = "centerpoint"

    head_channels: int
    heat_overlap: float = 0.1
    least_radius: int = 2
    box_heat: float = 1.0
    axis_code: bool = False

    @property
    def code(self) -> dict[str, int]:
        """The branches for the code of a box (see `targets.CentreGrid.encode`), by OpenPCDet's names, and how
        many numbers each predicts."""
        return {"center": 2, "center_z": 1, "dim": 3, "rot": 4 if self.axis_code else 2}


SMALL = CenterPointPreset(
    name="small",
    range_m=SECOND_SMALL.range_m,
    voxel_size_m=SECOND_SMALL.voxel_size_m,
    expected_input=SECOND_SMALL.expected_input,
    channels_3d=SECOND_SMALL.channels_3d,
    bev=(BevBlock(4, 1, 64, 1, 64), BevBlock(4, 2, 128, 2, 64)),
    head_channels=32,
    box_heat=0.2,
    axis_code=True,
    input_offset=SECOND_SMALL.input_offset,
    input_scale=SECOND_SMALL.input_scale,
    place_in_voxel=True,
    overlap_weight=0.5,
    nms_iou=0.1,
    vote_iou=0.5,
    suppress_by_class=True,
    quality_power=1.0,
)
"""SECOND's `small` with a head without anchors; trains on two CPU cores."""

WAYMO = CenterPointPreset(
    name="waymo",
    range_m=Range(-75.2, -75.2, -2.0, 75.2, 75.2, 4.0),
    voxel_size_m=(0.1, 0.1, 0.15),
    # Waymo's clouds stand in the vehicle's frame, whose origin is on the ground.
    expected_input=ExpectedInput(lidar_height_m=0.0),
    channels_3d=(16, 16, 32, 64, 64, 128),
    bev=(BevBlock(5, 1, 128, 1, 256), BevBlock(5, 2, 256, 2, 256)),
    classes=("car", "pedestrian", "cyclist"),
    head_channels=64,
    extra_features=1,
    layers_above=1,
    points_per_voxel=5,
    max_voxels=150_000,
    max_voxels_training=150_000,
    nms_iou=0.7,
    max_candidates=500,
    max_detections=500,
)
"""OpenPCDet's `centerpoint_without_resnet.yaml` for Waymo, number by number: 5,775,803 parameters, for
imported weights.

Its `car` is Waymo's vehicle, with trucks and buses. Its intensities are tanh of Waymo's, in [0, 1]. It also
reads a point's elongation, which our clouds lack: zero, as most of Waymo's points have it.
"""

PRESETS = {"small": SMALL, "waymo": WAYMO}
