"""The light on a patch as an image shows it: the signal of its white there, and of the air before it.

The scenario in the bag tells the sun, the sky and the weather. The exposure follows from the road, whose
reflectance is known. In the dark, where lamps light it, and on wet roads, which mirror, the body that it is
fixed to tells more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.stages.attack.camera.scene import CameraScene
from advpipe.stages.attack.camera.scene_light import Illumination

ROAD = 0.145
"""Diffuse reflectance of asphalt in our worlds."""

BODY = 0.3
"""Mean reflectance of the rear of a vehicle."""

FAR_M, NEAR_M = 45.0, 8.0
"""Road within these ranges tells the exposure, and whether the sun shines at the patch."""

LEAST_PIXELS = 50

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class PatchLight:
    """Signals of an image (see `exposure.signal_of`). white: (3,) of a white patch. air: (3,) of the light
    that the air before it scatters."""

    white: Float64
    air: Float64


def patch_light(
    scene: CameraScene,
    signal: npt.NDArray[np.float32],
    light: Illumination,
    target: str,
    optical_SE3_patch: Float64,
) -> PatchLight:
    """The light on the patch in an image with this signal (H, W, 3)."""
    exposure = _exposure(scene, signal, light)
    range_m = float(np.linalg.norm(optical_SE3_patch[:3, 3]))
    passed = float(light.transmittance(np.array(range_m)))
    air = exposure * light.horizon * (1 - passed)
    if light.is_dark or light.is_wet:
        body = signal[scene.pixels_of(target)]
        grey = float(np.median(body[:, 1])) if len(body) else 0.1
        return PatchLight(np.full(3, max(grey - float(air[1]), 0.002) / BODY), air)
    map_R_patch = (scene.map_SE3_base @ scene.base_SE3_optical @ optical_SE3_patch)[:3, :3]
    is_sunny = _is_sunny(scene, signal, light, exposure, range_m)
    return PatchLight(exposure * passed * light.white(-map_R_patch[:, 2], is_sunny), air)


def _road(scene: CameraScene, signal: npt.NDArray[np.float32], least_m: float, most_m: float) -> Float64:
    """The signal (N,) of the road at these ranges."""
    with np.errstate(invalid="ignore"):
        there = (scene.tags == TAG["Roads"]) & (scene.range_m > least_m) & (scene.range_m < most_m)
    found: Float64 = signal[there, 1].astype(np.float64)
    return found


def _exposure(scene: CameraScene, signal: npt.NDArray[np.float32], light: Illumination) -> float:
    """The exposure in 1/(kcd/m^2): that by which the brightest fifth of the road is in the sun or in the
    shade, whichever is nearer to the exposure of usual scenes."""
    usual = light.usual_exposure(signal)
    road = _road(scene, signal, 0, FAR_M)
    if len(road) < LEAST_PIXELS or light.is_dark or light.is_wet:
        return usual
    bright = float(np.quantile(road, 0.8))
    options = [bright / (ROAD * float(light.white(UP, sunny)[1])) for sunny in (True, False)]
    return min(options, key=lambda each: abs(np.log(each / usual)))


def _is_sunny(
    scene: CameraScene, signal: npt.NDArray[np.float32], light: Illumination, exposure: float, range_m: float
) -> bool:
    """Whether the road before the patch is in the sun."""
    road = _road(scene, signal, range_m - NEAR_M, range_m + 1)
    if len(road) < LEAST_PIXELS:
        return True
    sunny, shaded = (exposure * ROAD * float(light.white(UP, each)[1]) for each in (True, False))
    return bool(np.median(road) > np.sqrt(sunny * shaded))
