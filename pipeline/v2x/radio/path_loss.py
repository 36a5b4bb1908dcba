"""Mean loss with distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.section import Radio

SPEED_OF_LIGHT_MPS = 299_792_458.0
REFERENCE_M = 1.0
"""The path loss is constant below this distance."""


def free_space_db(distance_m: Float64, radio: Radio) -> Float64:
    """Friis' equation between isotropic antennas."""
    wavelength_m = SPEED_OF_LIGHT_MPS / radio.frequency_hz
    return 20 * np.log10(4 * np.pi / wavelength_m * np.maximum(distance_m, REFERENCE_M))


def dual_slope_db(distance_m: Float64, radio: Radio) -> Float64:
    """Free space to one metre, then one exponent up to the critical distance and another beyond it.

    Cheng et al., IEEE JSAC 25(8), 2007, equation 3.
    """
    critical_m, reference_db = (
        np.array(radio.critical_distance_m),
        free_space_db(np.array(REFERENCE_M), radio),
    )
    is_far = distance_m > critical_m
    loss_db = np.where(is_far, distance_m / critical_m, np.maximum(distance_m, REFERENCE_M))
    np.log10(loss_db, out=loss_db)
    loss_db *= np.where(is_far, 10 * radio.far_exponent, 10 * radio.near_exponent)
    loss_db += np.where(is_far, reference_db + 10 * radio.near_exponent * np.log10(critical_m), reference_db)
    return loss_db


PATH_LOSS: dict[str, Callable[[Float64, Radio], Float64]] = {
    "free_space": free_space_db,
    "dual_slope": dual_slope_db,
}
