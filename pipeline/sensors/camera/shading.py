"""The light that surfaces send to a camera."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.haze import extinction_per_m, veil
from advpipe.pipeline.sensors.camera.sky_map import SkyMap
from advpipe.pipeline.sensors.camera.surfaces import HEAD_LAMP, NO_LAMP, Surfaces

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]

THIN_SHARE = np.float32(0.55)
"""Share of the light on the far side of a leaf that shines through, against that on the near side."""

GLOSS_POWER, GLOSS_PEAK = np.float32(600.0), np.float32(95.0)
"""Lobe of the sun's mirror image on paint (Phong), normalised: (n + 2) / 2 pi."""

WET_COLOUR, WET_SPECULAR = np.float32(0.55), np.float32(0.02)
"""Wet roads are darker (Lekner and Dorf 1988) and reflect like water, of refractive index 1.33."""

PANE_SPECULAR = np.float32(0.07)
"""Reflectance at normal incidence of the two sides of a pane."""

LAMP_KCD = {True: 9.0, False: 2.5}
"""Luminance of lamps at night and by day (daytime running lights)."""

BEAM_KLX_M2 = 26.0
"""Luminous intensity of a pair of low beams in their middle, in kilocandela."""


class Shading:
    """Shades surfaces under one sky. range_m: of shadows that road users cast."""

    def __init__(self, sky: SkyMap) -> None:
        daylight = sky.daylight
        self._sky, self._is_dark = sky, daylight.is_dark
        self._sun = self.sun = daylight.sun.astype(np.float32)
        self._sun_light = daylight.sun_light.astype(np.float32)
        self._is_wet = daylight.weather.kind in ("rain", "snow")
        self._extinction = extinction_per_m(daylight.weather)
        self.has_sun = bool(self._sun_light.max() > 0.5)

    def sun_lit(self, surfaces: Surfaces) -> npt.NDArray[np.int64]:
        """Indices of the surfaces that face the sun, and are lit unless something is in between."""
        if not self.has_sun:
            return np.zeros(0, np.int64)
        facing = surfaces.normals @ self._sun > 0
        facing |= surfaces.is_thin
        facing &= np.isfinite(surfaces.range_m)
        return np.flatnonzero(facing)

    def shadow_origins(self, surfaces: Surfaces, rays: Float32, chosen: npt.NDArray[np.int64]) -> Float32:
        """Points (K, 3) just above the chosen surfaces, from which shadow rays start."""
        points = rays[chosen, :3] + surfaces.range_m[chosen, None] * rays[chosen, 3:]
        points += np.float32(0.012) * surfaces.normals[chosen]
        points += np.float32(0.012) * self._sun
        return points

    def radiance(
        self, surfaces: Surfaces, rays: Float32, is_lit: Bool, openness: Float32 | None, beam: Float64 | None
    ) -> Float32:
        """Luminance (R, 3) in kcd/m^2 of each ray (R, 6).

        is_lit: (R,), whether the sun shines there. openness: (R,), share of the sky that a surface faces
        beside what its normal says; None for all of it. beam: pose (4, 4) of the vehicle whose low beams
        light the scene, used only in the dark.
        """
        radiance = np.empty((len(rays), 3), np.float32)
        hit = np.isfinite(surfaces.range_m)
        solid, sky = np.flatnonzero(hit), np.flatnonzero(~hit)
        radiance[sky] = self._sky.luminance(rays[sky, 3:]) if len(sky) else 0
        normals = surfaces.normals[solid]
        light = normals @ self._sky.ambient[1:]
        light += self._sky.ambient[0]
        if openness is not None:
            light *= openness[solid, None]
        if self.has_sun:
            cos = normals @ self._sun
            thin = np.flatnonzero(surfaces.is_thin[solid])
            cos[thin] = np.maximum(cos[thin], -THIN_SHARE * cos[thin]) * np.float32(0.8)
            cos *= is_lit[solid]
            np.maximum(cos, 0, out=cos)
            light += cos[:, None] * (self._sun_light / np.float32(np.pi))
        if self._is_dark and beam is not None:
            light += _low_beams(surfaces, rays, solid, normals, beam)[:, None]
        light *= surfaces.colour[solid]
        if self._is_wet:
            light[surfaces.wets[solid]] *= WET_COLOUR
        radiance[solid] = light
        self._mirror(radiance, surfaces, rays, is_lit, openness)
        self._lamps(radiance, surfaces)
        self._panes(radiance, surfaces, rays)
        if self._extinction > 1e-4:
            veil(radiance, surfaces.range_m, rays[:, 5], self._extinction, self._sky.horizon)
        return radiance

    def _mirror(
        self, radiance: Float32, surfaces: Surfaces, rays: Float32, is_lit: Bool, openness: Float32 | None
    ) -> None:
        """Add what smooth surfaces reflect of the sky and the sun."""
        specular = surfaces.specular
        if self._is_wet:
            specular = np.where(surfaces.wets, WET_SPECULAR, specular)
        smooth = np.flatnonzero((specular > 0) & np.isfinite(surfaces.range_m))
        if not len(smooth):
            return
        fresnel, mirrored = _reflected(rays[smooth, 3:], surfaces.normals[smooth], specular[smooth])
        image = self._sky.luminance(mirrored)
        if openness is not None:
            image *= openness[smooth, None]
        if self._is_wet:  # what stands beside the road is darker than the sky above it
            image *= np.where(surfaces.wets[smooth], np.float32(0.6), np.float32(1))[:, None]
        elif self.has_sun:
            towards = np.maximum(mirrored @ self._sun, 0)
            glint = np.flatnonzero((towards > 0.98) & is_lit[smooth])
            lobe = GLOSS_PEAK * towards[glint] ** GLOSS_POWER
            image[glint] += lobe[:, None] * self._sun_light
        radiance[smooth] *= (1 - fresnel)[:, None]
        radiance[smooth] += fresnel[:, None] * image

    def _lamps(self, radiance: Float32, surfaces: Surfaces) -> None:
        lamps = np.flatnonzero(surfaces.lamps != NO_LAMP)
        if not len(lamps):
            return
        glow = np.float32(LAMP_KCD[self._is_dark])
        head = np.array([1.0, 0.97, 0.9], np.float32) * glow
        tail = np.array([0.9, 0.02, 0.02], np.float32) * glow * np.float32(0.25)
        radiance[lamps] += np.where((surfaces.lamps[lamps] == HEAD_LAMP)[:, None], head, tail)

    def _panes(self, radiance: Float32, surfaces: Surfaces, rays: Float32) -> None:
        panes = surfaces.panes
        if not len(panes.rays):
            return
        fresnel, mirrored = _reflected(
            rays[panes.rays, 3:], panes.normals, np.full(len(panes.rays), PANE_SPECULAR)
        )
        np.multiply.at(radiance, panes.rays, panes.transmittance[:, None])
        np.add.at(radiance, panes.rays, fresnel[:, None] * self._sky.luminance(mirrored))


def _reflected(directions: Float32, normals: Float32, specular: Float32) -> tuple[Float32, Float32]:
    """Reflectance (N,) after Schlick 1994, and mirrored directions (N, 3)."""
    cos = -np.einsum("ij,ij->i", directions, normals)
    away = 1 - np.clip(cos, 0, 1)
    square = away * away
    fresnel: Float32 = specular + (1 - specular) * (square * square * away)
    mirrored: Float32 = directions + (2 * cos)[:, None] * normals
    return fresnel, mirrored


def _low_beams(
    surfaces: Surfaces, rays: Float32, solid: npt.NDArray[np.int64], normals: Float32, map_SE3_base: Float64
) -> Float32:
    """Illuminance / pi (K,) of the surfaces by the vehicle's own low beams, with their cut-off."""
    lamp = (map_SE3_base @ [1.9, 0.0, 0.65, 1.0])[:3].astype(np.float32)
    axes = map_SE3_base[:3, :3].astype(np.float32)
    away = rays[solid, :3] + surfaces.range_m[solid, None] * rays[solid, 3:] - lamp
    ahead, left, up = (away @ axes).T
    distance = np.maximum(np.sqrt(np.einsum("ij,ij->i", away, away)), np.float32(0.5))
    forward = np.maximum(ahead, np.float32(0.1))
    across, height = left / forward, up / forward + np.float32(0.008)
    upper = np.where(height > 0, np.float32(0.02), np.float32(0.16))
    beam = np.exp(-np.square(across / np.float32(0.38)) - np.square(height / upper)) * (ahead > 0)
    cos = np.maximum(-np.einsum("ij,ij->i", away, normals) / distance, 0)
    lit: Float32 = np.float32(BEAM_KLX_M2 / np.pi) * beam * cos / np.square(distance)
    return lit
