"""How a camera sees a patch: which share of each pixel it covers, and the mix of texels there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.attack.camera.patch_place import Carrier, PatchSize, corners_px, is_behind, plane_hits
from advpipe.stages.attack.camera.scene import CameraScene

Int64 = npt.NDArray[np.int64]

OUT_M = 0.35
"""How far the body under the patch may stand out of the plane of its box's rear, and be behind it all the
same: boxes are not exact to the last bumper."""

CLOSE_M = 0.03
"""The same of what does not belong to that body, for rounding."""

KNOWN_M = 65.0
"""Range up to which depth images tell surfaces; a patch farther away is where its vehicle is."""

LEAST_RAYS, MOST_RAYS = 2, 5
"""Rays per pixel in each direction."""


@dataclass(frozen=True)
class PatchView:
    """The patch in one image.

    pixels: (P,) indices into the image, row by row, ascending. cover: (P,) share of each pixel that the patch
    covers. rows, texels, weights: (K,) the mix of each pixel: `weights` of the texels for each row of
    `pixels`; those of a pixel sum to its cover. range_m: to the middle of the patch.
    """

    pixels: Int64
    cover: Float64
    rows: Int64
    texels: Int64
    weights: Float64
    range_m: float

    @property
    def is_empty(self) -> bool:
        """Whether nothing of the patch is in view."""
        return not len(self.pixels)

    def mixed(self, texture: Float64) -> Float64:
        """What the pixels (P, 3) receive of a texture (h w, 3), which is as much as they are covered."""
        weighted = self.weights[:, None] * texture[self.texels]
        count = len(self.pixels)
        return np.stack([np.bincount(self.rows, weighted[:, c], count) for c in range(3)], axis=1)


def patch_view(
    scene: CameraScene,
    carrier: Carrier,
    texels: tuple[int, int],
    offset_m: tuple[float, float] = (0.0, 0.0),
    scale: float = 1.0,
) -> PatchView:
    """The view of a patch of `texels` (rows, columns) on its carrier; nothing where the scene does not know
    this.

    Rays from each pixel meet the plane of the patch, which holds for every lens. A pixel shows the patch
    unless its surface, as the depth image has it, is before that plane; as depth does, the patch shines
    through windows. offset_m, scale: by which the print is displaced (right, down) and larger than it should
    be.
    """
    optical_SE3_patch, size = carrier.optical_SE3_patch(scene), carrier.size
    if optical_SE3_patch is None:
        return _empty(np.nan)
    range_m = float(np.linalg.norm(optical_SE3_patch[:3, 3]))
    pixels = _candidates(scene, optical_SE3_patch, size)
    if not len(pixels):
        return _empty(range_m)
    count = _rays_per_side(scene, optical_SE3_patch, size, texels)
    width = scene.lens.size_px[0]
    steps = (np.arange(count) + 0.5) / count - 0.5
    across, down = (each.ravel() for each in np.meshgrid(steps, steps))
    places = np.stack([pixels % width, pixels // width], axis=1).astype(np.float64)
    rays = scene.lens.directions((places[:, None, :] + np.stack([across, down], axis=1)[None]).reshape(-1, 2))
    where_m, hit_m = plane_hits(rays, optical_SE3_patch)
    before = hit_m.reshape(len(pixels), -1) > _least_range(scene, carrier, pixels)[:, None]
    share = (where_m - np.array(offset_m)) / (np.array([size.width_m, size.height_m]) * scale) + 0.5
    with np.errstate(invalid="ignore"):
        on = ((share >= 0) & (share < 1)).all(axis=1) & ~before.ravel()
    chosen = np.flatnonzero(on)
    return _view(pixels, chosen // (count * count), share[chosen], texels, count * count, range_m)


def _least_range(scene: CameraScene, carrier: Carrier, pixels: Int64) -> Float64:
    """The range (P,) beyond which a patch is hidden in each pixel."""
    own, surface_m = carrier.own(scene).ravel()[pixels], scene.range_m.ravel()[pixels]
    if carrier.is_sticker:
        return np.where(own, np.nan_to_num(surface_m, nan=np.inf) + OUT_M, 0.0)
    hidden_m = surface_m + np.where(own, OUT_M, CLOSE_M)
    return np.where(np.isnan(surface_m), np.where(own, np.inf, KNOWN_M), hidden_m)


def _candidates(scene: CameraScene, pose: Float64, size: PatchSize) -> Int64:
    """The pixels around the patch."""
    edges = corners_px(scene, pose, size)
    if not np.isfinite(edges).all() or not is_behind(pose):
        return np.zeros(0, np.int64)
    width, height = scene.lens.size_px
    margin = 2 + 0.1 * (edges.max(axis=0) - edges.min(axis=0))  # lines bend in a fisheye
    left, top = np.maximum(np.floor(edges.min(axis=0) - margin), 0).astype(int)
    right, bottom = np.ceil(edges.max(axis=0) + margin).astype(int)
    right, bottom = min(right, width - 1), min(bottom, height - 1)
    if right < left or bottom < top:
        return np.zeros(0, np.int64)
    columns, rows = np.meshgrid(np.arange(left, right + 1), np.arange(top, bottom + 1))
    found: Int64 = (rows * width + columns).ravel()
    return found


def _rays_per_side(scene: CameraScene, pose: Float64, size: PatchSize, texels: tuple[int, int]) -> int:
    """As many rays as texels that a pixel covers, within limits."""
    edges = corners_px(scene, pose, size)
    seen_px = float(np.linalg.norm(edges[1] - edges[0]))
    return int(np.clip(np.ceil(texels[1] / max(seen_px, 1e-3)), LEAST_RAYS, MOST_RAYS))


def _view(
    pixels: Int64, of_pixel: Int64, share: Float64, texels: tuple[int, int], rays: int, range_m: float
) -> PatchView:
    """Mix the four texels around each ray that meets the patch."""
    rows, columns = texels
    place = share * (columns, rows) - 0.5
    low = np.floor(place)
    part = place - low
    used, of_used = np.unique(of_pixel, return_inverse=True)
    every_row, every_texel, every_weight = [], [], []
    for right in (0, 1):
        for down in (0, 1):
            column = np.clip(low[:, 0] + right, 0, columns - 1).astype(np.int64)
            row = np.clip(low[:, 1] + down, 0, rows - 1).astype(np.int64)
            weight = np.abs(1 - right - part[:, 0]) * np.abs(1 - down - part[:, 1]) / rays
            every_row.append(of_used)
            every_texel.append(row * columns + column)
            every_weight.append(weight)
    cover = np.bincount(of_used, minlength=len(used)) / rays
    return PatchView(
        pixels[used],
        cover,
        np.concatenate(every_row),
        np.concatenate(every_texel),
        np.concatenate(every_weight),
        range_m,
    )


def _empty(range_m: float) -> PatchView:
    none, no_shares = np.zeros(0, np.int64), np.zeros(0)
    return PatchView(none, no_shares, none, none, no_shares, range_m)
