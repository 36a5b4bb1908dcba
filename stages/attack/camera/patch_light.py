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
    """Signals of an image (see `exposure.signal_of`). white: of a white patch, (3,) or one for each of its
    pixels (P, 3). air: (3,) of the light that the air before it scatters."""

    white: Float64
    air: Float64


def patch_light(
    scene: CameraScene,
    signal: npt.NDArray[np.float32],
    light: Illumination,
    own: npt.NDArray[np.bool_],
    optical_SE3_patch: Float64,
    pixels: npt.NDArray[np.int64],
) -> PatchLight:
    """The light on the pixels (P,) of a patch in an image with this signal (H, W, 3).

    own: (H, W), whether a pixel is of what the patch is fixed to.
    """
    exposure = _exposure(scene, signal, light)
    range_m = float(np.linalg.norm(optical_SE3_patch[:3, 3]))
    passed = float(light.transmittance(np.array(range_m)))
    air = exposure * light.horizon * (1 - passed)
    if light.is_dark or light.is_wet:
        return PatchLight(_of_body(signal, own, pixels, float(air[1])), air)
    map_R_patch = (scene.map_SE3_base @ scene.base_SE3_optical @ optical_SE3_patch)[:3, :3]
    is_sunny = _is_sunny(scene, signal, light, exposure, range_m)
    return PatchLight(exposure * passed * light.white(-map_R_patch[:, 2], is_sunny), air)


def _of_body(
    signal: npt.NDArray[np.float32],
    own: npt.NDArray[np.bool_],
    pixels: npt.NDArray[np.int64],
    air: float,
) -> Float64:
    """The signal of white (P, 3), grey, by the body in the same row: low beams end at a height."""
    width = signal.shape[1]
    own = own.ravel()[pixels]
    row, levels = pixels // width, signal.reshape(-1, 3)[pixels, 1]
    whole = float(np.median(levels[own])) if own.any() else 0.1
    white = np.full(len(pixels), whole)
    for each in np.unique(row):
        there = own & (row == each)
        if there.any():
            white[row == each] = np.median(levels[there])
    grey: Float64 = np.maximum(white - air, 0.002)[:, None] / BODY
    return np.repeat(grey, 3, axis=1)


def _road(
    scene: CameraScene, signal: npt.NDArray[np.float32], light: Illumination, least_m: float, most_m: float
) -> tuple[Float64, Float64]:
    """The exposure by which the road at these ranges has its signal (N,), in the sun and in the shade."""
    with np.errstate(invalid="ignore"):
        there = (scene.tags == TAG["Roads"]) & (scene.range_m > least_m) & (scene.range_m < most_m)
    passed = light.transmittance(scene.range_m[there])
    air = light.horizon[1] * (1 - passed)
    sunny, shaded = (
        signal[there, 1] / (ROAD * light.white(UP, each)[1] * passed + air) for each in (True, False)
    )
    return sunny, shaded


def _exposure(scene: CameraScene, signal: npt.NDArray[np.float32], light: Illumination) -> float:
    """The exposure in 1/(kcd/m^2): that by which the brightest fifth of the road is in the sun or in the
    shade, whichever is nearer to the exposure of usual scenes."""
    usual, road = light.usual_exposure(signal), _road(scene, signal, light, 0, FAR_M)
    if len(road[0]) < LEAST_PIXELS or light.is_dark or light.is_wet:
        return usual
    options = [float(np.quantile(each, 0.8)) for each in road]
    return min(options, key=lambda each: abs(np.log(max(each, 1e-6) / usual)))


def _is_sunny(
    scene: CameraScene, signal: npt.NDArray[np.float32], light: Illumination, exposure: float, range_m: float
) -> bool:
    """Whether the road before the patch is in the sun."""
    road = _road(scene, signal, light, range_m - NEAR_M, range_m + 1)
    if len(road[0]) < LEAST_PIXELS:
        return True
    sunny, shaded = (abs(np.log(max(float(np.median(each)), 1e-6) / exposure)) for each in road)
    return bool(sunny <= shaded)
