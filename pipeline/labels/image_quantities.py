"""What can be measured of a camera image that an attack changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from advpipe.pipeline.labels.quantity import Quantity


@dataclass(frozen=True)
class ImageChange:
    """What became of one image. is_dropped: whether it never arrives. delay_s: by which it arrives late.
    other: whether it shows another image of the drive. pixel_share: share of its pixels inside the rectangle
    that was painted on. extent_m: least diagonal in metres of what was painted on a road user; None where
    it is unknown or on none."""

    is_dropped: bool = False
    delay_s: float = 0.0
    other: bool = False
    pixel_share: float = 0.0
    extent_m: float | None = None


IMAGES_DROPPED = Quantity[ImageChange](
    "images_dropped", "1", "images that never arrive", lambda change: float(change.is_dropped)
)
IMAGE_DELAY = Quantity[ImageChange](
    "image_delay_s", "s", "delay of an image", lambda change: change.delay_s, resolution=1e-6
)
IMAGES_REPLACED = Quantity[ImageChange](
    "images_replaced", "1", "images that show another moment", lambda change: float(change.other)
)
PIXEL_SHARE = Quantity[ImageChange](
    "pixel_share", "1", "share of an image that was painted on", lambda change: change.pixel_share
)
PAINT_EXTENT = Quantity[ImageChange](
    "paint_extent_m", "m", "diagonal of what was painted on a road user", lambda change: change.extent_m
)

IMAGE_QUANTITIES: Mapping[str, Quantity[ImageChange]] = {
    quantity.name: quantity
    for quantity in (IMAGES_DROPPED, IMAGE_DELAY, IMAGES_REPLACED, PIXEL_SHARE, PAINT_EXTENT)
}
