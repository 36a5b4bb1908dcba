"""The settings of a preset in all detector families, and in those on voxels or with an anchor head."""

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
class BevBlock:
    """One block of the bird's-eye backbone: its first layer strides, and `layers` more keep the map's size;
    its output is upsampled by `up_stride` to `up_channels`; with 0 of them only the next block reads it."""

    layers: int
    stride: int
    channels: int
    up_stride: int
    up_channels: int


@dataclass(frozen=True, kw_only=True)
class VoxelPreset(Preset):
    """The voxels of a network, and its bird's-eye backbone.

    bev: the blocks of the backbone. layers_above: empty layers of voxels above the range. points_per_voxel:
    only the first points of a voxel are used; None: all. max_voxels, max_voxels_training: only the first
    voxels of a cloud are used.
    """

    bev: tuple[BevBlock, ...]
    layers_above: int = 0
    points_per_voxel: int | None = None
    max_voxels: int | None = None
    max_voxels_training: int | None = None

    @property
    def grid_zyx(self) -> tuple[int, int, int]:
        """Voxels along z, y and x, empty layers above the range included."""
        r, (dx, dy, dz) = self.range_m, self.voxel_size_m
        return (
            round((r.z_max_m - r.z_min_m) / dz) + self.layers_above,
            round((r.y_max_m - r.y_min_m) / dy),
            round((r.x_max_m - r.x_min_m) / dx),
        )


@dataclass(frozen=True, kw_only=True)
class SparsePreset(VoxelPreset):
    """A network on the sparse 3D backbone.

    channels_3d: after the input layer, stages 1 to 4, and the z-compressing layer. input_offset, input_scale:
    the mean VFE's x, y, z, intensity enter the network as (value - offset) * scale. extra_features: further
    features of a point that the network reads and our clouds lack: zeros. place_in_voxel: it also reads where
    in its voxel the mean lies, from -1/2 to 1/2 along each axis, so that boxes are finer than voxels.
    """

    channels_3d: tuple[int, int, int, int, int, int]
    input_offset: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    input_scale: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    extra_features: int = 0
    place_in_voxel: bool = False

    @property
    def input_features(self) -> int:
        """How many features of a voxel the network reads."""
        return 4 + 3 * self.place_in_voxel + self.extra_features


@dataclass(frozen=True, kw_only=True)
class SuppressionPreset(Preset):
    """How candidate boxes become detections.

    At most `max_candidates` enter non-maximum suppression at `nms_iou`, at most `max_detections` come out.
    vote_iou: see `decode.vote`; None is plain suppression, as in OpenPCDet. suppress_by_class: boxes of
    different classes may overlap; where two classes are likely, both are returned.
    quality_power: the head also predicts each box's IoU with the truth, of which scores are made as in
    `decode.rated` (Wu et al. 2020, "IoU-aware Single-stage Object Detector"); None: no such output.
    overlap_weight: of 1 - IoU of each learned box with the truth in the loss of boxes, whose other parts
    treat each number of a box alone (Yu et al. 2016, "UnitBox").
    """

    nms_iou: float = 0.1
    max_candidates: int = 1000
    max_detections: int = 100
    vote_iou: float | None = None
    suppress_by_class: bool = False
    quality_power: float | None = None
    overlap_weight: float = 0.0


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
class AnchorPreset(SuppressionPreset):
    """The anchors of a network.

    direction_offset_rad: where the first of the two direction bins begins. anchors_to_edges: the outermost
    anchors lie on the faces of the range, not half a cell inside.
    """

    anchors: tuple[Anchor, ...]
    yaws_rad: tuple[float, ...] = (0.0, 1.5707963267948966)
    direction_offset_rad: float = 0.7853981633974483
    anchors_to_edges: bool = False


@dataclass(frozen=True, kw_only=True)
class AnchorVoxelPreset(AnchorPreset, VoxelPreset):
    """An anchor head on voxels."""
