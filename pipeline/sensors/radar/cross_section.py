"""Radar cross sections: of road users by class and aspect, and of all else by its surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.sensors.world import SURFACES

Float64 = npt.NDArray[np.float64]


class AspectPattern(NamedTuple):
    """RCS in dBsm at the front and rear, at the sides, and in between."""

    end: float
    side: float
    between: float


PATTERNS = {
    "car": AspectPattern(10.0, 20.0, 5.0),
    "truck": AspectPattern(18.0, 28.0, 13.0),
    "cyclist": AspectPattern(-4.0, 4.0, -5.0),
    "pedestrian": AspectPattern(-8.0, -8.0, -8.0),
}
"""Round numbers of the order of published measurements at 76 to 81 GHz, where there are any.

Cars and trucks: Geary et al., Automotive radar target characterization from 22 to 29 GHz and 76 to 81 GHz
(RadarCon 2013); Schipper et al., RCS measurement results for automotive related objects (EuCAP 2011).
Cyclists: Belgiovane and Chen, Bicycles and human riders backscattering at 77 GHz (EuCAP 2016). Pedestrians:
Fortuny-Guasch and Chareau, JRC report EUR 25762 (2013).
"""

LOBE_POWER = 16
"""Exponent of the cosine of a lobe: half of its height in decibels at 17 degrees from its axis."""

_PATTERNS = np.array([PATTERNS[name] for name in CLASSES])

GAMMA_DB = {
    "road": -35.0,
    "marking": -35.0,
    "pavement": -30.0,
    "ground": -15.0,
    "vegetation": -10.0,
    "building": -6.0,
    "pole": 3.0,
    "sign": 8.0,
    "barrier": 0.0,
    "vehicle": 0.0,
    "person": -8.0,
    "other": -6.0,
}
"""gamma of each surface in the constant-gamma model: an area A seen at the grazing angle psi has the RCS
gamma sin(psi) A, so gamma times the area across the beam.

Roads: asphalt is smooth at this wavelength and returns little at grazing incidence (Sarabandi, Li and
Nashashibi, Scattering from road surfaces at millimeter-wave frequencies, IEEE Trans. AP 45, 1997). Land: of
the order of the values of Long, Radar Reflectivity of Land and Sea (2001), and Ulaby and Dobson, Handbook of
Radar Scattering Statistics for Terrain (1989). Metal: assumed above 0 dB, as its edges and corners return
more than a rough surface.
"""

_GAMMA = np.array([10 ** (GAMMA_DB[name] / 10) for name in SURFACES])


def road_user_rcs_m2(labels: npt.NDArray[np.int64], aspect_rad: Float64) -> Float64:
    """Mean RCS (M,) of road users of classes (M,) that the radar sees at angles (M,) from their front."""
    end, side, between = _PATTERNS[labels].T
    along = np.cos(aspect_rad) ** 2
    lobes = (end - between) * along ** (LOBE_POWER // 2) + (side - between) * (1 - along) ** (LOBE_POWER // 2)
    return np.asarray(10 ** ((between + lobes) / 10))


def clutter_rcs_m2(
    surfaces: npt.NDArray[np.uint8] | None, range_m: Float64, ray_solid_angle_sr: float
) -> Float64:
    """Mean RCS (N,) of what N rays hit: gamma times the area across the ray's share of the field of view.

    surfaces: (N,) index into `SURFACES`; None where the world names none.
    """
    gamma = _GAMMA[-1] if surfaces is None else _GAMMA[surfaces]
    return np.asarray(gamma * range_m**2 * ray_solid_angle_sr)
