"""The light that surfaces send to a camera."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.haze import extinction_per_m, veil
from advpipe.pipeline.sensors.camera.long_rows import along, chosen_columns, turned
from advpipe.pipeline.sensors.camera.sky_map import SkyMap
from advpipe.pipeline.sensors.camera.surfaces import HEAD_LAMP, NO_LAMP, Surfaces

Float32 = npt.NDArray[np.float32]
Bool = npt.NDArray[np.bool_]

THIN_SHARE = np.float32(0.55)
"""Share of the light on the far side of a leaf that shines through, against that on the near side."""

GLOSS_POWER, GLOSS_PEAK = np.float32(600.0), np.float32(95.0)
"""Lobe of the sun's mirror image on paint (Phong), normalised: (n + 2) / 2 pi."""

WET_COLOUR, WET_SPECULAR = np.float32(0.45), np.float32(0.02)
"""Wet roads are darker (Lekner and Dorf 1988) and reflect like water, of refractive index 1.33."""

PANE_SPECULAR = np.float32(0.07)
"""Reflectance at normal incidence of the two sides of a pane."""

LAMP_KCD = {True: 9.0, False: 2.5}
"""Luminance of lamps at night and by day (daytime running lights)."""

INSIDE = np.float32(0.3)
"""Share of the light outside that there is in rooms and vehicles."""

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
        facing = along(self._sun, surfaces.normals) > 0
        facing |= surfaces.is_thin
        return np.flatnonzero(facing)

    def shadow_origins(self, surfaces: Surfaces, chosen: npt.NDArray[np.int64]) -> Float32:
        """Points (3, N) just above the chosen surfaces, from which shadow rays start."""
        points = chosen_columns(surfaces.points_m, chosen)
        points += np.float32(0.012) * chosen_columns(surfaces.normals, chosen)
        points += (np.float32(0.012) * self._sun)[:, None]
        return points

    def radiance(self, surfaces: Surfaces, is_lit: Bool, openness: Float32, beam: Float64) -> Float32:
        """Luminance (3, R) in kcd/m^2 of each ray.

        is_lit: (K,), whether the sun shines on a surface. openness: (K,), share of the sky that it faces
        beside what its normal says. beam: pose (4, 4) of the vehicle whose low beams light the scene in the
        dark.
        """
        light = self._light(surfaces, is_lit, openness, beam)
        light *= surfaces.colour
        if self._is_wet:
            light[:, surfaces.wets] *= WET_COLOUR
        self._mirror(light, surfaces, is_lit, openness)
        self._lamps(light, surfaces)
        radiance = np.empty_like(surfaces.directions)
        sky = self._sky.luminance(chosen_columns(surfaces.directions, surfaces.beyond))
        for channel, surface, beyond in zip(radiance, light, sky, strict=True):
            channel[surfaces.rays] = surface
            channel[surfaces.beyond] = beyond
        self._panes(radiance, surfaces)
        if self._extinction > 1e-4:
            range_m = np.full(radiance.shape[1], np.inf, np.float32)
            range_m[surfaces.rays] = surfaces.range_m
            veil(radiance, range_m, surfaces.directions[2], self._extinction, self._sky.horizon)
        return radiance

    def _light(self, surfaces: Surfaces, is_lit: Bool, openness: Float32, beam: Float64) -> Float32:
        """Irradiance / pi (3, K) of the surfaces."""
        light: Float32 = turned(self._sky.ambient[1:].T, surfaces.normals)
        light += self._sky.ambient[0][:, None]
        darker = np.flatnonzero(openness < 1)
        share = openness[darker]
        inside = np.flatnonzero(surfaces.is_inside)
        for channel in light:
            channel[darker] *= share
        if self.has_sun:
            cos = along(self._sun, surfaces.normals)
            thin = np.flatnonzero(surfaces.is_thin)
            cos[thin] = np.maximum(cos[thin], -THIN_SHARE * cos[thin]) * np.float32(0.8)
            np.maximum(cos, 0, out=cos)
            cos *= is_lit
            for channel in range(3):
                light[channel] += cos * (self._sun_light[channel] / np.float32(np.pi))
        if self._is_dark:
            light += _low_beams(surfaces, beam)
        for channel in light:
            channel[inside] *= INSIDE
        return light

    def _mirror(self, radiance: Float32, surfaces: Surfaces, is_lit: Bool, openness: Float32) -> None:
        """Add what smooth surfaces reflect of the sky and the sun."""
        specular = surfaces.specular
        if self._is_wet:
            specular = np.where(surfaces.wets, WET_SPECULAR, specular)
        smooth = np.flatnonzero((specular > 0) & ~surfaces.is_inside)
        if not len(smooth):
            return
        directions = chosen_columns(surfaces.directions, surfaces.rays[smooth])
        normals = chosen_columns(surfaces.normals, smooth)
        fresnel, mirrored = _reflected(directions, normals, specular[smooth])
        image = self._sky.luminance(mirrored)
        image *= openness[smooth]
        if self._is_wet:  # what stands beside the road is darker than the sky above it
            image *= np.where(surfaces.wets[smooth], np.float32(0.6), np.float32(1))
        elif self.has_sun:
            towards = np.maximum(along(self._sun, mirrored), 0)
            glint = np.flatnonzero((towards > 0.98) & is_lit[smooth])
            lobe = GLOSS_PEAK * towards[glint] ** GLOSS_POWER
            image[:, glint] += self._sun_light[:, None] * lobe
        image *= fresnel
        for own, reflected in zip(radiance, image, strict=True):
            own[smooth] = own[smooth] * (1 - fresnel) + reflected

    def _lamps(self, radiance: Float32, surfaces: Surfaces) -> None:
        lamps = np.flatnonzero(surfaces.lamps != NO_LAMP)
        if not len(lamps):
            return
        glow = np.float32(LAMP_KCD[self._is_dark])
        head = np.array([[1.0], [0.97], [0.9]], np.float32) * glow
        tail = np.array([[0.9], [0.02], [0.02]], np.float32) * glow * np.float32(0.25)
        radiance[:, lamps] += np.where(surfaces.lamps[lamps] == HEAD_LAMP, head, tail)

    def _panes(self, radiance: Float32, surfaces: Surfaces) -> None:
        panes = surfaces.panes
        if not len(panes.rays):
            return
        specular = np.full(len(panes.rays), PANE_SPECULAR)
        directions = chosen_columns(surfaces.directions, panes.rays)
        fresnel, mirrored = _reflected(directions, panes.normals, specular)
        image = self._sky.luminance(mirrored) * fresnel
        for channel in range(3):
            np.multiply.at(radiance[channel], panes.rays, panes.transmittance)
            np.add.at(radiance[channel], panes.rays, image[channel])


def _reflected(directions: Float32, normals: Float32, specular: Float32) -> tuple[Float32, Float32]:
    """Reflectance (N,) after Schlick 1994, and mirrored directions (3, N), of either side of a surface."""
    cos = -(directions * normals).sum(axis=0)
    away = 1 - np.minimum(np.abs(cos), 1)
    square = away * away
    fresnel: Float32 = specular + (1 - specular) * (square * square * away)
    mirrored: Float32 = directions + (2 * cos) * normals
    return fresnel, mirrored


def _low_beams(surfaces: Surfaces, map_SE3_base: Float64) -> Float32:
    """Illuminance / pi (K,) of the surfaces by the vehicle's own low beams, with their cut-off."""
    lamp = (map_SE3_base @ [1.9, 0.0, 0.65, 1.0])[:3].astype(np.float32)
    away = surfaces.points_m - lamp[:, None]
    ahead, left, up = turned(map_SE3_base[:3, :3].T, away)
    square = np.maximum((away * away).sum(axis=0), np.float32(0.25))
    forward = np.maximum(ahead, np.float32(0.1))
    across, height = left / forward, up / forward + np.float32(0.008)
    upper = np.where(height > 0, np.float32(0.02), np.float32(0.16))
    beam = np.exp(-np.square(across / np.float32(0.38)) - np.square(height / upper)) * (ahead > 0)
    cos = np.maximum(-(away * surfaces.normals).sum(axis=0) / np.sqrt(square), 0)
    lit: Float32 = np.float32(BEAM_KLX_M2 / np.pi) * beam * cos / square
    return lit
