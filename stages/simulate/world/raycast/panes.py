"""How much of a LiDAR's light comes back through a pane, by the angle at which it passes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.stages.simulate.world.raycast.materials import TRANSMITTANCE

Float32 = npt.NDArray[np.float32]

GLASS_INDEX = 1.52
"""Refractive index of soda-lime glass."""

_AT_NORMAL = ((GLASS_INDEX - 1) / (GLASS_INDEX + 1)) ** 2


def passed_share(materials: npt.NDArray[np.uint8], cos_incidence: Float32) -> Float32:
    """Two-way share (N,) of light that passes panes of these materials (N,), met at these angles (N,).

    `TRANSMITTANCE` at normal incidence. Aslant, both faces reflect more away (Fresnel, unpolarised), and the
    way through the absorbing glass is longer (Beer and Lambert): a windscreen at 65 degrees passes half of
    what it would at normal incidence.
    """
    cos = np.clip(cos_incidence, 1e-3, 1.0)
    inside = np.sqrt(1 - (1 - cos**2) / GLASS_INDEX**2)
    across = ((cos - GLASS_INDEX * inside) / (cos + GLASS_INDEX * inside)) ** 2
    along = ((inside - GLASS_INDEX * cos) / (inside + GLASS_INDEX * cos)) ** 2
    faces = (1 - (across + along) / 2) ** 4
    absorbed = TRANSMITTANCE[materials] / (1 - _AT_NORMAL) ** 4
    share: Float32 = (faces * absorbed ** (1 / inside)).astype(np.float32)
    return share
