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
    with np.errstate(divide="ignore"):  # no distance at all is near
        loss_db = np.asarray(np.log10(distance_m / critical_m))
    loss_db *= 10 * radio.far_exponent
    loss_db += reference_db + 10 * radio.near_exponent * np.log10(critical_m)
    (near,) = np.nonzero((distance_m <= critical_m).ravel())  # a few: sooner done apart than by masks
    near_db = np.log10(np.maximum(distance_m.take(near), REFERENCE_M))
    near_db *= 10 * radio.near_exponent
    near_db += reference_db
    loss_db.put(near, near_db)
    return loss_db


PATH_LOSS: dict[str, Callable[[Float64, Radio], Float64]] = {
    "free_space": free_space_db,
    "dual_slope": dual_slope_db,
}
