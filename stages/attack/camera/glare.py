"""The glare of a strong light in a lens: the image of the light, stray light around it, and streaks.

The spread of a point of light is that of Spencer, Shirley, Zimmerman and Greenberg, Physically-based glare
effects for digital images (SIGGRAPH 1995), for bright scenes: a core, and wings with the inverse cube and
square of the angle, which Vos found in the eye (CIE Journal 3, 1984). A clean lens scatters less than an eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.lens import Lens

LUMENS_PER_WATT = 300.0
"""Of white light."""

TINT = np.array([1.0, 0.98, 0.94])
"""Colour of the light in the linear primaries of sRGB."""

STREAK_DEG, STREAK_SHARE, STREAK_END_DEG = 0.12, 0.03, 9.0
"""Half width of a streak, its brightness in its middle over the squared angle, and where it fades, by eye:
what the blades of an aperture diffract."""

CORE_DEG = 0.02


@dataclass(frozen=True)
class Light:
    """A light that points at the camera. azimuth_deg, elevation_deg: where it stands, from the optical axis;
    positive is left and up. power_w: radiant power of its beam. divergence_mrad: full angle of the beam.
    source_m: diameter of the light itself. distance_m: to the camera."""

    azimuth_deg: float
    elevation_deg: float
    distance_m: float
    power_w: float
    divergence_mrad: float
    source_m: float

    @property
    def direction(self) -> Float64:
        """Unit vector (3,) in the optical frame."""
        azimuth, elevation = np.deg2rad(self.azimuth_deg), np.deg2rad(self.elevation_deg)
        level = np.cos(elevation)
        return np.array([-np.sin(azimuth) * level, -np.sin(elevation), np.cos(azimuth) * level])

    @property
    def illuminance_klx(self) -> float:
        """At the lens, without the air between: the beam's light over the area that it lights."""
        spot_m = self.source_m + self.divergence_mrad / 1000 * self.distance_m
        return float(self.power_w * LUMENS_PER_WATT / (np.pi / 4 * spot_m**2) / 1000)

    @property
    def radius_deg(self) -> float:
        """Half the angle under which the light itself appears."""
        return float(np.rad2deg(np.arctan(self.source_m / 2 / self.distance_m)))


def spread_per_sr(angle_deg: Float64) -> Float64:
    """Luminance around a point of light over its illuminance at the eye (Spencer et al. 1995, photopic)."""
    core = 2.61e6 * np.exp(-((angle_deg / CORE_DEG) ** 2))
    near = 20.91 / (angle_deg + CORE_DEG) ** 3
    wide = 72.37 / (angle_deg + CORE_DEG) ** 2
    spread: Float64 = 0.384 * core + 0.478 * near + 0.138 * wide
    return spread


class Glare:
    """The picture of a light in one lens, relative to its illuminance.

    blades: of the aperture, each edge of which makes two streaks. scatter: stray light of the lens over that
    of an eye.
    """

    def __init__(self, lens: Lens, light: Light, blades: int, scatter: float) -> None:
        width, height = lens.size_px
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        rays = lens.directions(np.column_stack([x.ravel(), y.ravel()]))
        along = light.direction
        right = np.cross([0.0, 1.0, 0.0], along)
        right /= np.linalg.norm(right)
        down = np.cross(along, right)
        with np.errstate(invalid="ignore"):
            angle_deg = np.rad2deg(np.arccos(np.clip(rays @ along, -1, 1)))
            turn = np.arctan2(rays @ down, rays @ right)
        pixel_deg = float(np.rad2deg(1 / np.mean(np.diag(lens.matrix)[:2])))
        disc_deg = max(light.radius_deg, pixel_deg / 2)
        disc_sr = 2 * np.pi * (1 - np.cos(np.deg2rad(disc_deg)))
        outside_deg = np.maximum(angle_deg - light.radius_deg, pixel_deg / 2)
        picture = scatter * spread_per_sr(outside_deg)
        picture = np.where(angle_deg <= disc_deg, picture + 1 / disc_sr, picture)
        picture += _streaks(angle_deg, turn, blades, pixel_deg)
        self._per_klx: npt.NDArray[np.float32] = (
            np.nan_to_num(picture).reshape(height, width).astype(np.float32)
        )

    def luminance(self, illuminance_klx: float) -> npt.NDArray[np.float32]:
        """Luminance (H, W, 3) in kcd/m^2 that the light adds."""
        added: npt.NDArray[np.float32] = self._per_klx[..., None] * (illuminance_klx * TINT).astype(
            np.float32
        )
        return added


def _streaks(angle_deg: Float64, turn_rad: Float64, blades: int, pixel_deg: float) -> Float64:
    """Luminance of the streaks over the illuminance; 0 without blades."""
    streaks = np.zeros(len(angle_deg))
    if not blades:
        return streaks
    half_deg = max(STREAK_DEG, 0.6 * pixel_deg)
    for edge in range(blades):
        axis = np.pi * (edge + 0.5) / blades * (2 if blades % 2 == 0 else 1)
        across_deg = angle_deg * np.sin(turn_rad - axis)
        line = np.exp(-((across_deg / half_deg) ** 2)) * STREAK_DEG / half_deg
        streaks = np.maximum(streaks, line)
    fading = 1 + (angle_deg / STREAK_END_DEG) ** 2
    return streaks * STREAK_SHARE * 100 / (angle_deg + 0.3) ** 2 / fading
