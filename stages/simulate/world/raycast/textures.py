"""Textures of visible light: how the colour of a material varies over its surface."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

Float32 = npt.NDArray[np.float32]

SIZE = 512
"""Side of the noise's tile; a power of two."""


@dataclass(frozen=True)
class Patch:
    """N places on surfaces of one material. x_m, y_m: (N,) float32 in the surface: eastward and northward on
    the ground, along the wall and up on walls. z_m: (N,) float32, height. detail_m: (N,) float32, size of a
    pixel on the surface; the mean stands for what is finer."""

    x_m: Float32
    y_m: Float32
    z_m: Float32
    detail_m: Float32


Texture = Callable[[Patch], Float32]
"""The factor (N,) by which the material's colour changes; its mean is about 1."""


@cache
def cloudy_tile() -> Float32:
    """Noise (SIZE, SIZE) with the power spectrum 1/f^2 and unit variance, periodic."""
    rng = np.random.default_rng(20260101)
    frequency = np.fft.fftfreq(SIZE)
    radius = np.hypot(frequency[:, None], frequency)
    radius[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.standard_normal((SIZE, SIZE))) / (radius + 0.004)
    noise = np.fft.ifft2(spectrum).real
    tile: Float32 = (noise / noise.std()).astype(np.float32).ravel()
    return tile


@cache
def grain_tile() -> Float32:
    """White noise (SIZE, SIZE) with unit variance."""
    return np.random.default_rng(20260102).standard_normal(SIZE * SIZE).astype(np.float32)


def smooth_noise(x_m: Float32, y_m: Float32, cell_m: float) -> Float32:
    """Cloudy noise (N,) of unit variance, with features of `cell_m` to 500 times that."""
    return _lookup(cloudy_tile(), x_m, y_m, cell_m)


def white_noise(x_m: Float32, y_m: Float32, cell_m: float) -> Float32:
    """Independent noise (N,) of unit variance in each cell."""
    return _lookup(grain_tile(), x_m, y_m, cell_m)


def _lookup(tile: Float32, x_m: Float32, y_m: Float32, cell_m: float) -> Float32:
    per_m = np.float32(1 / cell_m)
    place = (y_m * per_m).astype(np.int32)
    place &= SIZE - 1
    place *= SIZE
    column = (x_m * per_m).astype(np.int32)
    column &= SIZE - 1
    place += column
    return np.take(tile, place, mode="clip")


def _fade(patch: Patch, size_m: float) -> Float32:
    """How much of a detail of this size (N,) a pixel resolves, in [0, 1]."""
    share: Float32 = np.minimum(np.float32(size_m) / patch.detail_m, np.float32(1))
    return share


def _joints(place_m: Float32, pitch_m: float, width_m: float) -> Float32:
    """1 in the joints (N,) that are `pitch_m` apart, 0 elsewhere."""
    part = place_m * np.float32(1 / pitch_m)
    part -= np.floor(part)
    return (part < np.float32(width_m / pitch_m)).astype(np.float32)


def _plain(patch: Patch) -> Float32:
    return np.ones(len(patch.x_m), np.float32)


def _grain(patch: Patch) -> Float32:
    """Asphalt: aggregate, darker and lighter areas, and long patches where wheels run."""
    fine = white_noise(patch.x_m, patch.y_m, 0.012) * _fade(patch, 0.02)
    cracks = (np.abs(smooth_noise(patch.x_m, patch.y_m, 0.05)) < 0.012) * _fade(patch, 0.03)
    blotches = smooth_noise(patch.y_m, patch.x_m, 0.11)
    factor: Float32 = 1 + np.float32(0.14) * fine + np.float32(0.09) * blotches - np.float32(0.3) * cracks
    return factor


def _worn(patch: Patch) -> Float32:
    """Paint on a road, through which the asphalt shows."""
    worn = smooth_noise(patch.x_m, patch.y_m, 0.02) > 1.1
    factor: Float32 = 1 - np.float32(0.45) * worn + np.float32(0.05) * white_noise(patch.x_m, patch.y_m, 0.02)
    return factor


def _slabs(patch: Patch) -> Float32:
    """Concrete slabs."""
    joints = np.maximum(_joints(patch.x_m, 1.5, 0.025), _joints(patch.y_m, 1.5, 0.025)) * _fade(patch, 0.025)
    slab = white_noise(patch.x_m, patch.y_m, 1.5)
    stains = smooth_noise(patch.x_m, patch.y_m, 0.03)
    factor: Float32 = (1 + 0.05 * slab + 0.07 * stains) * (1 - 0.45 * joints)
    return factor.astype(np.float32)


def _paving(patch: Patch) -> Float32:
    """Paving stones in a half bond."""
    return _bond(patch, 0.2, 0.1, 0.012, 0.06)


def _bricks(patch: Patch) -> Float32:
    return _bond(patch, 0.25, 0.083, 0.012, 0.12)


def _bond(patch: Patch, long_m: float, high_m: float, joint_m: float, contrast: float) -> Float32:
    """Rows of stones, each row shifted by half a stone; joints are lighter than dark stones."""
    row = np.floor(patch.y_m * np.float32(1 / high_m))
    x_m = patch.x_m + row * np.float32(long_m / 2)
    joints = np.maximum(_joints(x_m, long_m, joint_m), _joints(patch.y_m, high_m, joint_m))
    stones = white_noise(x_m, row * np.float32(0.25), long_m) * _fade(patch, high_m)
    stains = smooth_noise(patch.x_m, patch.y_m, 0.04)
    light = joints * _fade(patch, joint_m)
    factor: Float32 = 1 + contrast * stones + 0.06 * stains + np.float32(0.25) * light
    return factor.astype(np.float32)


def _stone(patch: Patch) -> Float32:
    """Kerbstones of 1 m."""
    joints = _joints(patch.x_m + patch.y_m, 1.0, 0.015) * _fade(patch, 0.015)
    return 1 + np.float32(0.08) * smooth_noise(patch.x_m, patch.y_m, 0.02) - np.float32(0.4) * joints


def _grass(patch: Patch) -> Float32:
    blades = white_noise(patch.x_m, patch.y_m, 0.03) * _fade(patch, 0.05)
    tufts = smooth_noise(patch.x_m, patch.y_m, 0.05)
    meadow = smooth_noise(patch.y_m, patch.x_m, 0.4)
    factor: Float32 = 1 + np.float32(0.22) * blades + np.float32(0.14) * tufts + np.float32(0.12) * meadow
    return np.maximum(factor, np.float32(0.3))


def _leaves(patch: Patch) -> Float32:
    """Leaves of a cluster, lit and in shade."""
    height = patch.z_m + np.float32(0.4) * patch.y_m
    leaf = white_noise(patch.x_m + patch.y_m, height, 0.06) * _fade(patch, 0.12)
    bunch = smooth_noise(patch.x_m, height, 0.03)
    factor: Float32 = np.float32(0.95) + np.float32(0.4) * leaf + np.float32(0.22) * bunch
    return np.maximum(factor, np.float32(0.15))


def _bark(patch: Patch) -> Float32:
    grooves = white_noise(patch.x_m + np.float32(0.5) * patch.y_m, np.floor(patch.z_m * 2), 0.03)
    return 1 + np.float32(0.2) * grooves * _fade(patch, 0.05)


def _plaster(patch: Patch) -> Float32:
    """Rendered walls with stains that run down."""
    streaks = smooth_noise(patch.x_m, patch.y_m * np.float32(0.12), 0.03)
    blotches = smooth_noise(patch.x_m, patch.y_m, 0.05)
    return 1 + np.float32(0.05) * streaks + np.float32(0.04) * blotches


def _roof_tiles(patch: Patch) -> Float32:
    """Rows of roof tiles."""
    row = np.floor(patch.z_m * np.float32(1 / 0.22))
    edge = _joints(patch.z_m, 0.22, 0.05) * _fade(patch, 0.1)
    tile = white_noise(patch.x_m + patch.y_m, row * np.float32(0.3), 0.3) * _fade(patch, 0.3)
    factor: Float32 = 1 - np.float32(0.35) * edge + np.float32(0.12) * tile
    return factor


TEXTURES: Mapping[str, Texture] = {
    "plain": _plain,
    "grain": _grain,
    "worn": _worn,
    "slabs": _slabs,
    "paving": _paving,
    "bricks": _bricks,
    "stone": _stone,
    "grass": _grass,
    "leaves": _leaves,
    "bark": _bark,
    "plaster": _plaster,
    "tiles": _roof_tiles,
}
"""Every texture by its key."""
