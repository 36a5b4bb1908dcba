"""A section of a picture, enlarged, mirrored and in another light, with the objects in it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.image_detector.targets import PictureObjects
from advpipe.stages.train.camera.config import ImageAugmentation

LEAST_SHARE = 0.35
"""Objects of whose box less is in the section are not learned there."""

BACKGROUND = 102
"""The value of pixels beyond the picture, near the mean."""

Image = npt.NDArray[np.uint8]


def section_of(
    rgb: Image,
    objects: PictureObjects,
    settings: ImageAugmentation,
    class_weights: npt.NDArray[np.float64],
    rng: np.random.Generator,
) -> tuple[npt.NDArray[np.float32], PictureObjects]:
    """The section (3, h, w), in 0 to 1, and its objects. class_weights: (C,), how much a class is sought."""
    low, high = settings.scale
    scale = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    left, top = _place(rgb, objects, scale, settings, class_weights, rng)
    image, found = _cut(rgb, objects, left, top, scale, settings.size_px)
    if settings.flip and rng.random() < 0.5:
        last = settings.size_px[0] - 1
        image = image[:, ::-1]
        boxes = found.boxes_px.copy()
        boxes[:, [0, 2]] = last - found.boxes_px[:, [2, 0]]
        found = PictureObjects(boxes, found.labels, found.is_learned)
    pixels = image.astype(np.float32) / 255
    gains = (1 + rng.uniform(-settings.light, settings.light)) * (
        1 + rng.uniform(-settings.colour, settings.colour, 3)
    )
    pixels *= gains.astype(np.float32)
    mean = pixels.mean()
    pixels = mean + (pixels - mean) * np.float32(1 + rng.uniform(-settings.contrast, settings.contrast))
    return np.ascontiguousarray(np.clip(pixels, 0, 1).transpose(2, 0, 1)), found


def _place(
    rgb: Image,
    objects: PictureObjects,
    scale: float,
    settings: ImageAugmentation,
    class_weights: npt.NDArray[np.float64],
    rng: np.random.Generator,
) -> tuple[float, float]:
    """The section's top left corner in the picture."""
    size = np.array(settings.size_px) / scale
    limit = np.array([rgb.shape[1], rgb.shape[0]]) - size
    corner = rng.uniform(np.minimum(limit, 0), np.maximum(limit, 0))
    sought = np.flatnonzero(objects.is_learned)
    if len(sought) and rng.random() < settings.focused:
        sides = objects.boxes_px[sought, 2:] - objects.boxes_px[sought, :2]
        weights = class_weights[objects.labels[sought]] * np.sqrt(sides.prod(axis=1) + 1.0)
        chosen = objects.boxes_px[rng.choice(sought, p=weights / weights.sum())]
        middle = (chosen[:2] + chosen[2:]) / 2 + rng.uniform(-0.35, 0.35, 2) * size
        corner = np.clip(middle - size / 2, np.minimum(limit, 0), np.maximum(limit, 0))
    left, top = corner.tolist()
    return left, top


def _cut(
    rgb: Image, objects: PictureObjects, left: float, top: float, scale: float, size_px: tuple[int, int]
) -> tuple[Image, PictureObjects]:
    """The section from this corner of the picture on, enlarged by `scale`."""
    from PIL import Image as Pictures

    width, height = size_px
    edges = np.array([left, top, left + width / scale, top + height / scale])
    inside = np.clip(edges, 0, [rgb.shape[1], rgb.shape[0]] * 2)
    first = np.rint((inside[:2] - edges[:2]) * scale).astype(int)
    last = np.maximum(np.rint((inside[2:] - edges[:2]) * scale).astype(int), first + 1)
    size = last - first
    part = Pictures.fromarray(rgb).resize(
        (int(size[0]), int(size[1])), Pictures.Resampling.BILINEAR, box=tuple(inside.tolist())
    )
    image = np.full((height, width, 3), BACKGROUND, np.uint8)
    image[first[1] : last[1], first[0] : last[0]] = np.asarray(part)[: height - first[1], : width - first[0]]
    return image, _cut_objects(objects, edges[:2], scale, size_px)


def _cut_objects(
    objects: PictureObjects, corner: npt.NDArray[np.float64], scale: float, size_px: tuple[int, int]
) -> PictureObjects:
    # Edges of pixels, not centres, are enlarged.
    boxes = (objects.boxes_px + [-0.5, -0.5, 0.5, 0.5] + 0.5 - np.tile(corner, 2)) * scale
    cut = np.clip(boxes, 0, np.array(size_px * 2))
    sides, whole = cut[:, 2:] - cut[:, :2], boxes[:, 2:] - boxes[:, :2]
    share = sides.prod(axis=1) / whole.prod(axis=1)
    kept = (sides > 2).all(axis=1)
    inner = (cut + [0.0, 0.0, -1.0, -1.0])[kept].astype(np.float32)
    return PictureObjects(inner, objects.labels[kept], (objects.is_learned & (share >= LEAST_SHARE))[kept])
