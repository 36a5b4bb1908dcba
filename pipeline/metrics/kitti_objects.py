"""The objects of KITTI's label and result files, and how much detections overlap them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.iou import iou_3d, iou_bev, shared_areas

Float64 = npt.NDArray[np.float64]

DONT_CARE = "DontCare"


@dataclass(frozen=True)
class KittiObjects:
    """The N objects, or detections, of one frame: the columns of a KITTI label file.

    names: their types, such as `Car`. bbox_px: (N, 4) left, top, right, bottom in the image. truncated: (N,)
    share outside of the image, 0 to 1. occluded: (N,) 0 to 3. boxes: (N, 7) height, width, length in metres,
    x, y, z of the centre of the bottom in rectified camera coordinates (x right, y down, z forward), and
    rotation_y in radians. alpha_rad: (N,) observation angle, -10 where unknown. scores: (N,) of detections.

    Raises ValueError for arrays of other shapes and for scores that are not finite.
    """

    names: tuple[str, ...]
    bbox_px: Float64
    truncated: Float64
    occluded: Float64
    boxes: Float64
    alpha_rad: Float64
    scores: Float64 | None = None

    def __post_init__(self) -> None:
        count = len(self.names)
        shapes = {
            **{"bbox_px": (count, 4), "boxes": (count, 7)},
            **dict.fromkeys(("truncated", "occluded", "alpha_rad", "scores"), (count,)),
        }
        for name, shape in shapes.items():
            if (values := getattr(self, name)) is not None:
                array = np.asarray(values, dtype=np.float64).reshape(shape if not count else np.shape(values))
                if array.shape != shape:
                    raise ValueError(f"{name} has shape {array.shape}, but {count} objects need {shape}")
                object.__setattr__(self, name, array)
        if self.scores is not None and not np.isfinite(self.scores).all():
            raise ValueError("scores that are not finite")

    def upright_boxes(self) -> Float64:
        """The boxes (N, 7), columns `geometry.boxes.BOX_COLUMNS`, in the camera's place with axes x right,
        y forward and z up."""
        height, width, length, x, y, z, rotation_y = self.boxes.T
        return np.column_stack([x, z, height / 2 - y, length, width, height, -rotation_y])


@dataclass(frozen=True)
class KittiOverlaps:
    """The overlap of the K detections of one frame with its N objects.

    bbox, bev, volume: (K, N) IoU of 2D boxes, in the bird's-eye view, and in 3D. dont_care: (K,) the largest
    share of the detection's 2D box in one of the regions `DontCare`. similarity: (K, N) of the observation
    angles, 0 to 1.
    """

    bbox: Float64
    bev: Float64
    volume: Float64
    dont_care: Float64
    similarity: Float64

    @classmethod
    def of(cls, truth: KittiObjects, detections: KittiObjects) -> KittiOverlaps:
        """Regions `DontCare` have no 3D box; their overlap is 0."""
        is_region = np.array([name == DONT_CARE for name in truth.names], dtype=bool)
        objects = np.flatnonzero(~is_region)
        found, known = detections.upright_boxes(), truth.upright_boxes()[objects]
        bev, volume = (np.zeros((len(found), len(truth.names))) for _ in range(2))
        bev[:, objects], volume[:, objects] = iou_bev(found, known), iou_3d(found, known)
        inside, area, areas = shared_areas(detections.bbox_px, truth.bbox_px)
        union = area[:, None] + areas - inside
        share = _quotient(inside[:, is_region], np.broadcast_to(area[:, None], inside[:, is_region].shape))
        return cls(
            bbox=_quotient(inside, union),
            bev=bev,
            volume=volume,
            dont_care=share.max(axis=1, initial=0.0),
            similarity=(1 + np.cos(truth.alpha_rad - detections.alpha_rad[:, None])) / 2,
        )

    def in_space(self, space: str) -> Float64:
        """The overlaps (K, N) in `bbox`, `bev` or `3d`."""
        return {"bbox": self.bbox, "bev": self.bev, "3d": self.volume}[space]


def _quotient(part: Float64, whole: Float64) -> Float64:
    """The share; 0 where there is no part."""
    return np.divide(part, whole, out=np.zeros(part.shape), where=part > 0)
