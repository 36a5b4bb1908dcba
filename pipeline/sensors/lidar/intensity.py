"""The strength of a surface's return, and its probability of detection."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.world import Hits, SurfaceDetail

Float32 = npt.NDArray[np.float32]

ROUGHNESS_RAD = np.deg2rad(20.0)
_VARIANCE = ROUGHNESS_RAD**2
GRAZING_SHARE = np.float32(0.45 * _VARIANCE / (_VARIANCE + 0.09) / (1 - 0.5 * _VARIANCE / (_VARIANCE + 0.33)))
"""Return of a rough surface at grazing incidence, as a share of that at normal incidence: 0.30.

Oren and Nayar, Generalization of Lambert's reflectance model (SIGGRAPH 1994), with light and eye in the
same place: A cos + B sin^2, here over A. Facets of 20 degrees are those of asphalt and plaster.
"""

RETRO_SIGNAL = np.float32(220.0)
"""Signal of a retroreflector. Sheeting of class RA1 returns 70 cd/lx/m^2 (EN 12899-1), a white
Lambertian surface 1/pi: 220 times as much. It saturates the receiver, so its intensity is 1."""

RETROREFLECTIVE_LIMIT_RAD = np.deg2rad(40.0)
"""Sheeting is retroreflective up to an entrance angle of some 40 degrees (EN 12899-1 requires 5 to 40)."""

DETECTED_AT_RANGE = 0.9
"""Probability of detecting a target of `range_reflectivity` at `range`, for which manufacturers state the
range."""


GLOSS_VARIANCE = np.float32(np.deg2rad(12.0) ** 2)
"""Variance of the slope of the flakes in metallic paint: the light of a lobe falls with tan^2 of the angle
(Beckmann and Spizzichino 1963), to 0.70 at 10 degrees and 0.02 at 30."""

WATER_INDEX = np.float32(1.33)


def return_signal(
    hits: Hits, seen: npt.NDArray[np.intp], attenuation_per_m: float, detail: SurfaceDetail | None = None
) -> Float32:
    """Signal (len(seen),) float32 of the rays `seen`; 1 is a white diffuse target at normal incidence.

    It is reflectivity x incidence (Oren-Nayar) x transmission of window panes x exp(-a d), as in CARLA, and
    with the texture and gloss of `detail`, if given. There is no other dependence on range: sensors report
    calibrated reflectivity, not power.
    """
    cos = hits.cos_incidence[seen]
    signal = cos + GRAZING_SHARE * (1 - cos * cos)
    signal *= hits.reflectivity[seen]
    if detail is not None:
        signal *= detail.texture[seen]
        gloss = detail.gloss[seen]
        glossy = np.flatnonzero(gloss)
        signal[glossy] *= 1 - gloss[glossy] * (1 - gloss_lobe(cos[glossy]))
    retro = np.flatnonzero(hits.retroreflective[seen])
    signal[retro[cos[retro] >= np.float32(np.cos(RETROREFLECTIVE_LIMIT_RAD))]] = RETRO_SIGNAL
    signal *= hits.transmission[seen]
    signal *= np.exp(hits.range_m[seen] * np.float32(-attenuation_per_m))
    return signal


def gloss_lobe(cos: Float32) -> Float32:
    """Light (N,) that a glossy surface returns, relative to that at normal incidence."""
    square = np.maximum(np.square(cos), np.float32(1e-4))
    lobe: Float32 = np.exp((1 - 1 / square) / (2 * GLOSS_VARIANCE))
    return lobe


def wet_share(cos: Float32) -> Float32:
    """Signal (N,) of a rough surface under a film of water, relative to the dry one.

    Light passes the film twice, with Fresnel losses (Schlick 1994), and spreads on leaving over n^2 times the
    solid angle (Lekner and Dorf, Why some things are darker when wet, 1988): 0.54 at normal incidence, 0.21
    at 80 degrees; the rest of a grazing beam is mirrored away.
    """
    normal = ((WATER_INDEX - 1) / (WATER_INDEX + 1)) ** 2
    passed = 1 - (normal + (1 - normal) * (1 - cos) ** 5)
    share: Float32 = np.square(passed) / WATER_INDEX**2
    return share


def noise_floor(sensor: LidarSensor, range_m: Float32, reflectivity: float | None = None) -> Float32:
    """Signal (N,) that is detected with probability 0.9 at each range (N,): it grows with range squared."""
    at_range = sensor.range_reflectivity if reflectivity is None else reflectivity
    floor: Float32 = np.square(range_m * np.float32(np.sqrt(at_range) / sensor.range))
    return floor


def detected_share(margin: Float32) -> Float32:
    """Probability (N,) of detection of a signal that is `margin` (N,) times the noise floor.

    1 - (1 - 0.9)^(margin^2): a smooth step through the one point that manufacturers state.
    """
    lost: Float32 = np.exp(np.square(np.minimum(margin, 1e3)) * np.float32(np.log(1 - DETECTED_AT_RANGE)))
    return 1 - lost


def kept_share(sensor: LidarSensor, intensity: Float32) -> Float32:
    """Share (N,) of returns kept by CARLA's `dropoff_*` parameters.

    A share of all returns is lost randomly, and of the weak ones a share that falls linearly from
    `dropoff_zero_intensity` at intensity 0 to nothing at `dropoff_intensity_limit`.
    """
    share = np.full(len(intensity), 1 - sensor.dropoff_general_rate, np.float32)
    if sensor.dropoff_intensity_limit > 0:
        weakness = np.maximum(1 - intensity / np.float32(sensor.dropoff_intensity_limit), 0)
        share *= 1 - np.float32(sensor.dropoff_zero_intensity) * weakness
    return share
