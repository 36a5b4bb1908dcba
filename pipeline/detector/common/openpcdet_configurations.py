"""Which configuration of OpenPCDet a checkpoint belongs to, told by the names and shapes of its weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Shapes = Mapping[str, tuple[int, ...]]


@dataclass(frozen=True)
class Configuration:
    """One that can be imported. file: OpenPCDet's name of it; network, data: its network and training data;
    family: ours."""

    file: str
    network: str
    data: str
    family: str


CONFIGURATIONS = (
    Configuration("second.yaml", "SECOND", "KITTI", "second"),
    Configuration("pointpillar.yaml", "PointPillars", "KITTI", "pointpillars"),
    Configuration("centerpoint_without_resnet.yaml", "CenterPoint", "Waymo", "centerpoint"),
)

INPUT, PILLAR_INPUT = "backbone_3d.conv_input.0.weight", "vfe.pfn_layers.0.linear.weight"
WAYMO_FEATURES = 5
"""A point of Waymo has its elongation, too."""

SCORES, HEAT = "dense_head.conv_cls.weight", "dense_head.heads_list.0.hm.1.weight"
KITTI_SCORES, WAYMO_CLASSES = 3 * 2 * 3, 3
"""Outputs at a cell: three classes at two yaws of an anchor of each; peaks of three classes."""


def configuration_of(family: str) -> Configuration:
    """The one that a family of ours takes."""
    (found,) = (each for each in CONFIGURATIONS if each.family == family)
    return found


def refusal(shapes: Shapes, wanted: Configuration) -> str:
    """Why a checkpoint with weights of these names and shapes is none of the configuration that is wanted,
    as far as it is recognised as another one: else ""."""
    other = _other_network(shapes)
    if other:
        takes = "; ".join(f"{each.file} ({each.data})" for each in CONFIGURATIONS)
        return f"holds {other} of OpenPCDet, which is not imported; what is: {takes}"
    found = _importable(shapes)
    if found is None or found == wanted:
        return ""
    return f"holds a {found.network} of OpenPCDet's {found.file}; pass --family {found.family}"


def _importable(shapes: Shapes) -> Configuration | None:
    second, pillars, centres = CONFIGURATIONS
    if _has(shapes, "dense_head.heads_list."):
        return centres
    if _has(shapes, "dense_head.conv_cls."):
        if _has(shapes, "vfe.pfn_layers."):
            return pillars
        return second if _has(shapes, "backbone_3d.conv_input.") else None
    return None


def _other_network(shapes: Shapes) -> str:
    """The network that advpipe lacks, and the files that configure it; "" for one that is not recognised."""
    if _has(shapes, "roi_head."):
        return _two_stages(shapes)
    if _has(shapes, "backbone_3d.SA_modules."):
        return "a network on points, such as 3DSSD or IA-SSD"
    if _has(shapes, "dense_head.decoder."):
        return "a network with a transformer as its head, such as TransFusion (transfusion_lidar.yaml)"
    on_pillars = _has(shapes, "vfe.pfn_layers.")
    if on_pillars and _has(shapes, "backbone_3d."):
        return "a network on pillars with a 3D backbone, such as DSVT or PillarNet"
    if _has(shapes, "vfe.ffn."):
        return "a network on images (CaDDN.yaml)"
    if _has(shapes, "dense_head.rpn_heads."):
        files = "cbgs_pp_multihead" if on_pillars else "second_multihead.yaml, cbgs_second_multihead"
        return f"a network of several heads ({files}.yaml)"
    if _has(shapes, "dense_head.heads_list."):
        return _other_centres(shapes, on_pillars)
    if _has(shapes, "dense_head.conv_cls."):
        return _other_anchors(shapes)
    return ""


def _other_centres(shapes: Shapes, on_pillars: bool) -> str:
    if _has(shapes, "backbone_3d.conv5."):
        return "a VoxelNeXt (cbgs_*_voxelnext.yaml and others)"
    if _has(shapes, "dense_head.heads_list.0.vel."):
        return "a CenterPoint for nuScenes (cbgs_*_centerpoint.yaml)"
    if on_pillars:
        return "a CenterPoint on pillars (centerpoint_pillar_1x.yaml)"
    if _has(shapes, "backbone_3d.conv1.0.conv1."):
        return "a CenterPoint with residual layers (centerpoint.yaml)"
    if _outputs(shapes, HEAT) not in (None, WAYMO_CLASSES):
        return "a CenterPoint for other classes than Waymo's, such as once_models/centerpoint.yaml"
    return ""


def _other_anchors(shapes: Shapes) -> str:
    if _has(shapes, "backbone_3d.conv1.0.conv1."):
        return "a SECOND with residual layers"
    if WAYMO_FEATURES in shapes.get(INPUT, ())[-2:]:
        return "a SECOND for Waymo (waymo_models/second.yaml)"
    if shapes.get(PILLAR_INPUT, ())[-1:] == (WAYMO_FEATURES + 6,):
        return "a PointPillars for Waymo (pointpillar_1x.yaml)"
    if _outputs(shapes, SCORES) not in (None, KITTI_SCORES):
        return "a network with anchors for other classes than KITTI's, such as once_models/second.yaml"
    return ""


def _outputs(shapes: Shapes, convolution: str) -> int | None:
    """The channels that a convolution of this name puts out; None without one."""
    shape = shapes.get(convolution, ())
    return shape[0] if len(shape) == 4 else None


def _two_stages(shapes: Shapes) -> str:
    if _has(shapes, "roi_head.iou_layers."):
        return "a SECOND-IoU (second_iou.yaml)"
    if _has(shapes, "pfe."):
        return "a PV-RCNN (pv_rcnn.yaml)"
    if not _has(shapes, "dense_head."):
        return "a PointRCNN (pointrcnn.yaml)"
    if _has(shapes, "point_head."):
        return "a Part-A2 (PartA2.yaml)"
    return "a Voxel R-CNN (voxel_rcnn_car.yaml) or another network of two stages"


def _has(shapes: Shapes, prefix: str) -> bool:
    return any(name.startswith(prefix) for name in shapes)
