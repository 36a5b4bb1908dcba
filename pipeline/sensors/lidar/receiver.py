"""What a LiDAR's receiver makes of the light of its targets: detection, and the error of the range."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.lidar.atmosphere import ASSUMED_REFLECTIVITY, Atmosphere, transmission
from advpipe.pipeline.sensors.lidar.intensity import detected_share, kept_share, noise_floor
from advpipe.pipeline.sensors.lidar.section import LidarSensor
from advpipe.pipeline.sensors.lidar.targets import Targets

Float32 = npt.NDArray[np.float32]

CLEAR_MARGIN = np.float32(2.0)
"""For a sensor that detects everything in range, the return of every surface in clear air is at least this
many times the noise floor; bad weather reduces this margin."""

WEAK_NOISE_M = 0.09
"""The range error of a return as strong as the noise is this over sqrt(2) (LISA, Kilic et al. 2021)."""

BLUR = np.float32(0.05)
"""Standard deviation of the range on a slanted surface, as a share of the depth of the beam's spot. The
receiver measures the middle of a long echo to this share of its length; assumed."""

DEEPEST_M = np.float32(1.5)
"""Greatest depth of a spot that counts: 5 ns of light, beyond which an echo is cut."""


class Received(NamedTuple):
    """Of N targets: signal (N,), share (N,) of such returns that are reported, stddev_m (N,) of the range."""

    signal: Float32
    share: Float32
    stddev_m: Float32


def received(sensor: LidarSensor, air: Atmosphere | None, targets: Targets) -> Received:
    """What of the targets' light is detected through the air."""
    range_m, clear = targets.range_m, targets.signal
    signal, share, weak_m2 = clear, np.ones_like(clear), np.float32(0)
    has_reflectivity, weak_noise_m = sensor.range_reflectivity > 0, sensor.imperfections.weak_noise_m
    if air is not None or has_reflectivity or weak_noise_m:
        margin = clear / noise_floor(sensor, range_m, None if has_reflectivity else ASSUMED_REFLECTIVITY)
        if not has_reflectivity:
            np.maximum(margin, CLEAR_MARGIN, out=margin)
        inverse = 1 / np.maximum(margin, np.float32(1e-6))
        if weak_noise_m:
            weak_m2 = np.float32(weak_noise_m**2) * np.minimum(inverse, 1)
        if air is not None:
            transmitted = transmission(air, range_m) * targets.wet
            signal = clear * transmitted
            excess = (1 / np.maximum(transmitted, np.float32(1e-20)) - 1) * inverse
            weak_m2 = weak_m2 + np.float32(WEAK_NOISE_M**2 / 2) * excess
            margin *= transmitted
        if air is not None or has_reflectivity:
            share = detected_share(margin)
    share *= kept_share(sensor, np.minimum(signal, 1))
    variance = np.float32(sensor.noise_stddev**2) + weak_m2 + np.square(_blur_m(sensor, targets))
    return Received(signal, share, np.sqrt(variance))


def _blur_m(sensor: LidarSensor, targets: Targets) -> Float32:
    """Standard deviation of the range (N,) because the beam's spot reaches from near to far."""
    cos = np.maximum(targets.cos_incidence, np.float32(0.02))
    depth_m = targets.range_m * np.float32(np.deg2rad(sensor.imperfections.beam_divergence_deg))
    depth_m *= np.sqrt(1 / np.square(cos) - 1)
    blur_m: Float32 = BLUR * np.minimum(depth_m, DEEPEST_M)
    return blur_m
