"""A printed patch: its texture, what ink can show, and an image with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.messages.compressed_image import UInt8
from advpipe.pipeline.sensors.camera.exposure import levels_of
from advpipe.stages.attack.camera.base import PaintedArea
from advpipe.stages.attack.camera.patch_light import PatchLight
from advpipe.stages.attack.camera.patch_view import PatchView

BLACK, WHITE = 0.04, 0.85
"""Reflectance of black ink and of white paper."""


def reflectance(texture: Float64) -> Float64:
    """Of a texture in 0 to 1, coded as sRGB, in print."""
    linear = np.where(texture > 0.04045, ((texture + 0.055) / 1.055) ** 2.4, texture / 12.92)
    printed: Float64 = BLACK + (WHITE - BLACK) * linear
    return printed


TEXEL_PX = 16
"""Side of a square of the texture in the file to print."""


def printed(texture: Float64, texels: tuple[int, int]) -> UInt8:
    """The file to print of a texture (h w, 3) of `texels` (rows, columns)."""
    levels = np.rint(255 * texture).astype(np.uint8).reshape(*texels, 3)
    enlarged: UInt8 = levels.repeat(TEXEL_PX, axis=0).repeat(TEXEL_PX, axis=1)
    return enlarged


@dataclass(frozen=True)
class PatchImage:
    """A patch in one image. view: of it. light: on it. signal: (P, 3) float32, of the image's pixels there
    without it."""

    view: PatchView
    light: PatchLight
    signal: npt.NDArray[np.float32]

    def painted(self, texture: Float64) -> npt.NDArray[np.float32]:
        """The signal (P, 3) with a texture (h w, 3)."""
        cover = self.view.cover[:, None]
        printed = self.view.mixed(reflectance(texture)) * self.light.white + cover * self.light.air
        painted: npt.NDArray[np.float32] = (self.signal * (1 - cover) + printed).astype(np.float32)
        return painted

    def paint(self, rgb: UInt8, texture: Float64) -> UInt8:
        """The image (H, W, 3) with the patch."""
        changed = rgb.reshape(-1, 3).copy()
        changed[self.view.pixels] = levels_of(self.painted(texture))
        return changed.reshape(rgb.shape)

    def area(self, width: int, target: str) -> PaintedArea:
        """What the labels say of it, in an image of this width."""
        rows, columns = np.divmod(self.view.pixels, width)
        edges = int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max())
        return PaintedArea(edges, len(self.view.pixels), target)
