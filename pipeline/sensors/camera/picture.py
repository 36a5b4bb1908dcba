"""The picture of one camera at one instant: primary and shadow rays, their light, and smooth edges."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.contact import ContactShadows
from advpipe.pipeline.sensors.camera.lens import Lens
from advpipe.pipeline.sensors.camera.long_rows import along, chosen_columns
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.shading import Shading
from advpipe.pipeline.sensors.camera.surfaces import Surfaces, VisibleSurroundings

Float32 = npt.NDArray[np.float32]
Int64 = npt.NDArray[np.int64]

MAX_RAYS = 1 << 18
"""Most rays that are cast at once, for flat memory. Open3D casts them with all cores while it holds the
interpreter's lock: a second thread that cast and shaded another part made a picture a tenth later on an AMD
EPYC, and hardly earlier on an Intel Xeon."""

WORKERS = 2
"""Threads that develop, count layers and compress."""

OFFSETS_PX = ((0.0, -0.36), (0.32, 0.2), (-0.32, 0.2))
"""Where the three further rays of a pixel pass, beside the one through its centre."""

SHADOW_RANGE_M = 60.0
"""Range of the road users that cast shadows."""


@dataclass(frozen=True)
class Layers:
    """What the rays through the centres of P = H W pixels meet, row by row.

    range_m: (P,) float32. tags: (P,) uint8. objects: (P,) int32, -1 for none. visible: (M,) int64, number of
    pixels of each road user; alone: (M,) int64, the same if nothing else were there. visible_px, alone_px:
    (M, 4) int64, first and last column and row of those: left, top, right, bottom.
    """

    range_m: Float32
    tags: npt.NDArray[np.uint8]
    objects: npt.NDArray[np.int32]
    visible: Int64
    alone: Int64
    visible_px: Int64
    alone_px: Int64


@dataclass(frozen=True)
class View:
    """Where a camera looks from. map_SE3_optical, map_SE3_base: (4, 4). time_s: after the instant."""

    map_SE3_optical: Float64
    map_SE3_base: Float64
    time_s: float = 0.0


class Photographer:
    """Casts and shades the rays of one lens. range_m: of road users. samples: 1 or 4 rays per pixel. workers:
    threads for what needs no rays."""

    def __init__(self, lens: Lens, range_m: float, samples: int) -> None:
        self.lens, self._range_m, self._samples = lens, range_m, samples
        width, height = self.size_px = lens.size_px
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        rays = lens.directions(np.column_stack([x.ravel(), y.ravel()]))
        self._blind = np.flatnonzero(np.isnan(rays).any(axis=1))
        rays[self._blind] = (0.0, 0.0, 1.0)
        self._directions: Float32 = np.ascontiguousarray(rays.T, np.float32)
        middle = lens.directions(np.array([[width / 2, height / 2], [width / 2 + 1, height / 2]]))
        self.workers = ThreadPoolExecutor(WORKERS)
        self._pixel_rad = float(np.linalg.norm(middle[1] - middle[0]))

    def take(
        self, world: VisibleSurroundings, view: View, boxes: Float64, shading: Shading | None
    ) -> tuple[Float32 | None, Layers]:
        """The radiance (3, H, W), None without shading, and the layers of one image."""
        width, height = self.size_px
        first = _FirstPass(width * height, len(boxes))
        contact = ContactShadows(boxes, view.map_SE3_optical[:3, 3])
        radiance = None if shading is None else np.empty((3, width * height), np.float32)
        rows = max(MAX_RAYS // width, 1)

        for top in range(0, height, rows):
            pixels = slice(top * width, min(top + rows, height) * width)
            rays = self._rays(view, self._directions[:, pixels])
            surfaces = world.surfaces(rays, self._range_m, self._pixel_rad, view.time_s)
            is_lit = None if shading is None else _sun_lit(world, shading, surfaces)
            first.take(pixels, surfaces, is_lit)
            if shading is None or radiance is None or is_lit is None:
                continue
            share = _openness(contact, surfaces)
            radiance[:, pixels] = shading.radiance(surfaces, is_lit, share, view.map_SE3_base)
        first.blind(self._blind)
        if radiance is None or shading is None:
            return None, first.layers(self._blind, width)
        layers = self.workers.submit(first.layers, self._blind, width)
        self._smooth(world, view, contact, shading, radiance, first)
        radiance[:, self._blind] = 0.0
        return radiance.reshape(3, height, width), layers.result()

    def _smooth(
        self,
        world: VisibleSurroundings,
        view: View,
        contact: ContactShadows,
        shading: Shading,
        radiance: Float32,
        first: _FirstPass,
    ) -> None:
        """Average further rays of the pixels at edges, or of all, in place."""
        if self._samples == 1:
            chosen = np.flatnonzero(first.edges(*self.size_px))
        else:
            chosen = np.arange(radiance.shape[1])
        per_cast = max(MAX_RAYS // len(OFFSETS_PX), 1)
        for start in range(0, len(chosen), per_cast):
            pixels = chosen[start : start + per_cast]
            rays = self._rays(view, self._beside(pixels))
            surfaces = world.surfaces(rays, self._range_m, self._pixel_rad, view.time_s)
            is_lit = _sun_lit(world, shading, surfaces)
            share = _openness(contact, surfaces)
            further = shading.radiance(surfaces, is_lit, share, view.map_SE3_base)
            total = further.reshape(3, len(OFFSETS_PX), -1).sum(axis=1)
            radiance[:, pixels] = (radiance[:, pixels] + total) * np.float32(1 / (1 + len(OFFSETS_PX)))

    def _beside(self, pixels: Int64) -> Float32:
        """Directions (3, 3 K) that pass beside the centres of pixels (K,), by those of their neighbours."""
        width, height = self.size_px
        aside = np.where(pixels % width + 1 < width, 1, -1)
        below = np.where(pixels + width < width * height, width, -width)
        own = chosen_columns(self._directions, pixels)
        right = (chosen_columns(self._directions, pixels + aside) - own) * aside.astype(np.float32)
        down = (chosen_columns(self._directions, pixels + below) - own) * np.sign(below).astype(np.float32)
        beside = np.concatenate(
            [own + np.float32(x) * right + np.float32(y) * down for x, y in OFFSETS_PX], axis=1
        )
        beside /= np.sqrt((beside * beside).sum(axis=0))
        return beside

    def _rays(self, view: View, directions: Float32) -> Float32:
        """Rays (N, 6) in the map frame with these directions (3, N) in the optical frame."""
        rays = np.empty((directions.shape[1], 6), np.float32)
        for axis, (*row, origin_m) in enumerate(view.map_SE3_optical[:3]):
            rays[:, axis] = origin_m
            rays[:, 3 + axis] = along(row, directions)
        return rays


def _openness(contact: ContactShadows, surfaces: Surfaces) -> Float32:
    """See `ContactShadows.openness`, for surfaces (K,)."""
    level = np.flatnonzero((surfaces.normals[2] > np.float32(0.7)) & (surfaces.objects < 0))
    return contact.openness(surfaces.points_m, level)


def _sun_lit(world: VisibleSurroundings, shading: Shading, surfaces: Surfaces) -> npt.NDArray[np.bool_]:
    is_lit = np.zeros(len(surfaces.rays), np.bool_)
    facing = shading.sun_lit(surfaces)
    if len(facing):
        origins = shading.shadow_origins(surfaces, facing)
        is_lit[facing] = ~world.is_shaded(origins, shading.sun, SHADOW_RANGE_M)
    return is_lit


class _FirstPass:
    """Collects what the rays through the centres of all pixels meet."""

    def __init__(self, pixels: int, users: int) -> None:
        self.range_m = np.full(pixels, np.inf, np.float32)
        self.tags = np.full(pixels, TAG["Sky"], np.uint8)
        self.objects = np.full(pixels, -1, np.int32)
        self._keys = np.zeros(pixels, np.int32)
        self._is_fine = np.zeros(pixels, np.bool_)
        self._alone: list[tuple[Int64, Int64]] = []
        self._users = users

    def take(self, pixels: slice, surfaces: Surfaces, is_lit: npt.NDArray[np.bool_] | None) -> None:
        """Take the surfaces of a band of pixels; is_lit: (K,), None without light."""
        place = surfaces.rays + pixels.start
        self.range_m[place], self.tags[place] = surfaces.range_m, surfaces.tags
        self.objects[place] = surfaces.objects
        self._alone.append((surfaces.alone_rays + pixels.start, surfaces.alone_users))
        if is_lit is None:
            return
        x, y, z = (surfaces.normals * np.float32(3) + np.float32(3.5)).astype(np.int32)
        keys = surfaces.objects + np.int32(2)
        for value, bits in ((surfaces.materials, 8), (is_lit, 1), (x, 3), (y, 3), (z, 3)):
            keys <<= bits
            keys |= value
        self._keys[place], self._is_fine[place] = keys, surfaces.is_fine

    def blind(self, blind: Int64) -> None:
        """Let pixels (K,) have met nothing."""
        self.range_m[blind], self.tags[blind], self.objects[blind] = np.inf, 0, -1

    def layers(self, blind: Int64, width: int) -> Layers:
        alone_pixels, alone_users = (np.concatenate(column) for column in zip(*self._alone, strict=True))
        if len(blind):
            seen = ~np.isin(alone_pixels, blind)
            alone_pixels, alone_users = alone_pixels[seen], alone_users[seen]
        own = np.flatnonzero(self.objects >= 0)
        visible, visible_px = extents(own, self.objects[own].astype(np.int64), self._users, width)
        alone, alone_px = extents(alone_pixels, alone_users, self._users, width)
        return Layers(self.range_m, self.tags, self.objects, visible, alone, visible_px, alone_px)

    def edges(self, width: int, height: int) -> npt.NDArray[np.bool_]:
        """Pixels (H W,) that differ from a neighbour in more than texture."""
        shape = height, width
        edges = self._is_fine.reshape(shape).copy()
        keys = self._keys.reshape(shape)
        near = (1 / np.maximum(self.range_m, np.float32(0.1))).reshape(shape)
        for a, b in (
            ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
            ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
        ):
            differs = keys[a] != keys[b]
            differs |= np.abs(near[a] - near[b]) > np.float32(0.06) * np.maximum(near[a], near[b])
            edges[a] |= differs
            edges[b] |= differs
        return edges.ravel()


def extents(pixels: Int64, users: Int64, count: int, width: int) -> tuple[Int64, Int64]:
    """Number (M,) of pixels of each user, and their first and last column and row (M, 4); -1 for none.

    pixels, users: (N,), pairs of a pixel, row by row, and a user in it.
    """
    edges = np.full((count, 4), -1, np.int64)
    low = np.full((2, count), np.iinfo(np.int64).max)
    column, row = pixels % width, pixels // width
    for axis, place in enumerate((column, row)):
        np.minimum.at(low[axis], users, place)
        np.maximum.at(edges[:, 2 + axis], users, place)
    numbers = np.bincount(users, minlength=count)
    edges[:, :2] = np.where(numbers > 0, low, -1).T
    return numbers, edges
