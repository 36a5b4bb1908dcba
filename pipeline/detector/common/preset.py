"""The settings of a preset in all detector families, and in those with an anchor head."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from advpipe.pipeline.detector.expected_input import ExpectedInput
from advpipe.pipeline.detector.protocol import Range
from advpipe.pipeline.geometry.boxes import CLASSES


@dataclass(frozen=True, kw_only=True)
class Preset:
    """The shape of a network; a checkpoint names its family and its preset.

    family: its registered name. range_m: the network's input range. voxel_size_m: size of a voxel along x, y
    and z. classes: the classes that it detects, each one of `geometry.boxes.CLASSES`. expected_input: the
    clouds that it is made for; a checkpoint may say otherwise.
    """

    family: ClassVar[str]

    name: str
    range_m: Range
    voxel_size_m: tuple[float, float, float]
    classes: tuple[str, ...] = CLASSES
    expected_input: ExpectedInput | None = None


@dataclass(frozen=True)
class Anchor:
    """One anchor size, which the head uses at every cell of the bird's-eye map and at all yaws.

    An anchor learns from a labelled box of its own class when their bird's-eye IoU reaches
    `positive_iou`, from the background when every IoU stays under `negative_iou`.
    """

    class_name: str
    length_m: float
    width_m: float
    height_m: float
    bottom_z_m: float
    positive_iou: float
    negative_iou: float


@dataclass(frozen=True, kw_only=True)
class AnchorPreset(Preset):
    """The anchors of a network, and how its predictions become boxes.

    direction_offset_rad: where the first of the two direction bins begins. anchors_to_edges: the outermost
    anchors lie on the faces of the range, not half a cell inside.

    Decoding: at most `max_candidates` anchors enter non-maximum suppression at `nms_iou`, at most
    `max_detections` come out. vote_iou: see `decode.vote`; None is plain suppression, as in OpenPCDet.
    suppress_by_class: boxes of different classes may overlap; where two classes are likely, both are
    returned.
    quality_power: the head also predicts each box's IoU with the truth, and a detection scores
    class score * IoU**power (Wu et al. 2020, "IoU-aware Single-stage Object Detector"); None: no such output.
    """

    anchors: tuple[Anchor, ...]
    yaws_rad: tuple[float, ...] = (0.0, 1.5707963267948966)
    direction_offset_rad: float = 0.7853981633974483
    anchors_to_edges: bool = False
    nms_iou: float = 0.1
    max_candidates: int = 1000
    max_detections: int = 100
    vote_iou: float | None = None
    suppress_by_class: bool = False
    quality_power: float | None = None


@dataclass(frozen=True)
class BevBlock:
    """One block of the bird's-eye backbone: its first layer strides, and `layers` more keep the map's size;
    its output is upsampled by `up_stride` to `up_channels`."""

    layers: int
    stride: int
    channels: int
    up_stride: int
    up_channels: int
