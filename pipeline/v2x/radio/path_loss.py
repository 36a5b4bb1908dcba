"""Mean loss with distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.scenario.v2x import Radio

SPEED_OF_LIGHT_MPS = 299_792_458.0
REFERENCE_M = 1.0
"""Nearer than this, nothing gets stronger."""


def free_space_db(distance_m: Float64, radio: Radio) -> Float64:
    """Friis' equation between isotropic antennas."""
    wavelength_m = SPEED_OF_LIGHT_MPS / radio.frequency_hz
    return 20 * np.log10(4 * np.pi / wavelength_m * np.maximum(distance_m, REFERENCE_M))


def dual_slope_db(distance_m: Float64, radio: Radio) -> Float64:
    """Free space to one metre, then one exponent up to the critical distance and another beyond it.

    Cheng et al., IEEE JSAC 25(8), 2007, equation 3.
    """
    nearer_m = np.clip(distance_m, REFERENCE_M, radio.critical_distance_m)
    farther = np.maximum(distance_m / radio.critical_distance_m, 1.0)
    at_reference_db = free_space_db(np.array(REFERENCE_M), radio)
    near_db = 10 * radio.near_exponent * np.log10(nearer_m / REFERENCE_M)
    return at_reference_db + near_db + 10 * radio.far_exponent * np.log10(farther)


PATH_LOSS: dict[str, Callable[[Float64, Radio], Float64]] = {
    "free_space": free_space_db,
    "dual_slope": dual_slope_db,
}
