"""The 2D boxes of road users in an image: visible and amodal, with truncation and occlusion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes, box_corners
from advpipe.pipeline.geometry.transforms import Float64, invert, transform_points
from advpipe.pipeline.kitti.class_names import KITTI_NAMES
from advpipe.pipeline.kitti.object_label import observation_angle
from advpipe.pipeline.kitti.occlusion import occlusion_level
from advpipe.pipeline.messages.labels import ImageLabel
from advpipe.pipeline.sensors.camera.lens import Lens
from advpipe.pipeline.sensors.camera.picture import Layers

Int64 = npt.NDArray[np.int64]

_GRID = np.linspace(-0.5, 0.5, 9)
_FACES = np.array(
    [p for p in np.stack(np.meshgrid(_GRID, _GRID, _GRID), axis=-1).reshape(-1, 3) if np.abs(p).max() == 0.5]
)
"""Places all over a box's surface, in shares of its sides."""


@dataclass(frozen=True)
class ImageObject:
    """One road user that would be in the image if nothing hid it.

    index: among the boxes. visible_px, amodal_px: left, top, right, bottom column and row, both inclusive;
    visible_px is None for one that is hidden. truncation: share outside the image. visible_share: of its
    pixels inside the image, those that nothing else hides.
    """

    index: int
    id: str
    class_name: str
    visible_px: tuple[int, int, int, int] | None
    amodal_px: tuple[int, int, int, int]
    truncation: float
    visible_share: float
    observation_angle_rad: float

    @property
    def label(self) -> ImageLabel:
        """As KITTI labels it: the amodal box in the image; occlusion 3 where nothing of it is visible."""
        left, top, right, bottom = map(float, self.amodal_px)
        return ImageLabel(
            self.id,
            KITTI_NAMES[self.class_name],
            (left, top, right, bottom),
            self.truncation,
            occlusion_level(1 - self.visible_share) if self.visible_px else 3,
            self.observation_angle_rad,
        )


def image_objects(boxes: Boxes, layers: Layers, lens: Lens, map_SE3_optical: Float64) -> list[ImageObject]:
    """The road users in an image, in the order of the boxes, which are in the map frame."""
    found = []
    optical_SE3_map = invert(map_SE3_optical)
    present = np.flatnonzero(layers.alone)
    corners = box_corners(boxes.geometry[present]).reshape(-1, 3)
    pixels = lens.project(transform_points(optical_SE3_map, corners)).reshape(-1, 16)
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0) & (pixels <= np.tile(np.array(lens.size_px) - 1, 8))
    is_whole: npt.NDArray[np.bool_] = np.asarray(inside.all(axis=1))
    for index, whole in zip(present, is_whole, strict=True):
        box = boxes.geometry[index]
        bottom = transform_points(optical_SE3_map, box[:3] - (0, 0, box[5] / 2))
        ahead = optical_SE3_map[:3, :3] @ [np.cos(box[6]), np.sin(box[6]), 0.0]
        rotation_y = float(np.arctan2(-ahead[2], ahead[0]))
        shows = layers.visible[index] > 0
        found.append(
            ImageObject(
                int(index),
                boxes.ids[index],
                CLASSES[boxes.labels[index]],
                _edges(layers.visible_px[index]) if shows else None,
                _edges(layers.alone_px[index]),
                0.0 if whole else _truncation(box, lens, optical_SE3_map),
                float(layers.visible[index] / layers.alone[index]),
                float(observation_angle((float(bottom[0]), float(bottom[1]), float(bottom[2])), rotation_y)),
            )
        )
    return found


def _edges(extents: Int64) -> tuple[int, int, int, int]:
    left, top, right, bottom = extents.tolist()
    return left, top, right, bottom


def _truncation(box: Float64, lens: Lens, optical_SE3_map: Float64) -> float:
    """Share of the 2D box outside the image; of the surface, for a box that reaches behind the camera."""
    width, height = lens.size_px
    middle, turn = box_corners(box)[0].mean(axis=0), box[6]
    local = _FACES * box[3:6]
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
    pixels = lens.project(transform_points(optical_SE3_map, local @ rotation.T + middle))
    if not np.isfinite(pixels).all():
        with np.errstate(invalid="ignore"):
            inside = ((pixels >= -0.5) & (pixels <= (width - 0.5, height - 0.5))).all(axis=1)
        return float(1 - inside.mean())
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    limit = np.array([width - 1.0, height - 1.0])
    inner = np.clip(high, 0, limit) - np.clip(low, 0, limit)
    return float(np.clip(1 - np.prod(inner) / max(float(np.prod(high - low)), 1e-9), 0, 1))
