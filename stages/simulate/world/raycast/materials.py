"""Materials: how surfaces reflect and transmit a LiDAR's light at 905 nm, and their semantic classes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Material(NamedTuple):
    """`reflectivity`: diffuse, in [0, 1]. `semantic`: one of `SEMANTIC_CLASSES`.

    `retroreflective`: whether it reflects most light back to its source. `transmittance`: the two-way share
    of light that passes a pane; 0 for an opaque material.
    """

    reflectivity: float
    semantic: str
    retroreflective: bool = False
    transmittance: float = 0.0


SEMANTIC_CLASSES = (
    "road", "marking", "pavement", "ground", "vegetation", "building", "pole", "sign", "barrier",
    "vehicle", "person", "other",
)  # fmt: skip

_MATERIALS = {
    "asphalt": Material(0.14, "road"),
    "asphalt_new": Material(0.08, "road"),
    "asphalt_old": Material(0.21, "road"),
    "marking": Material(0.75, "marking"),
    "marking_worn": Material(0.45, "marking"),
    "concrete": Material(0.35, "pavement"),
    "paving": Material(0.30, "pavement"),
    "kerbstone": Material(0.40, "pavement"),
    "grass": Material(0.42, "ground"),
    "soil": Material(0.25, "ground"),
    "foliage": Material(0.50, "vegetation"),
    "conifer": Material(0.40, "vegetation"),
    "bark": Material(0.30, "vegetation"),
    "masonry": Material(0.45, "building"),
    "plaster": Material(0.60, "building"),
    "roof_tile": Material(0.38, "building"),
    "facade_dark": Material(0.20, "building"),
    "facade_concrete": Material(0.35, "building"),
    "room": Material(0.30, "building"),
    "pane": Material(0.10, "building", transmittance=0.55),
    "glass": Material(0.10, "vehicle", transmittance=0.80),
    "glass_tinted": Material(0.10, "vehicle", transmittance=0.50),
    "steel": Material(0.40, "pole"),
    "wood": Material(0.45, "other"),
    "rail": Material(0.45, "barrier"),
    "barrier_concrete": Material(0.40, "barrier"),
    "sign": Material(0.95, "sign", retroreflective=True),
    "sign_back": Material(0.35, "sign"),
    "plate": Material(0.85, "vehicle", retroreflective=True),
    "lamp": Material(0.60, "vehicle", retroreflective=True),
    "rubber": Material(0.05, "vehicle"),
    "rim": Material(0.45, "vehicle"),
    "plastic": Material(0.12, "vehicle"),
    "interior": Material(0.10, "vehicle"),
    "frame": Material(0.35, "vehicle"),
    "tarpaulin": Material(0.55, "vehicle"),
    "cloth": Material(0.40, "person"),
    "cloth_dark": Material(0.15, "person"),
    "skin": Material(0.50, "person"),
    "bin": Material(0.20, "other"),
    "paint_black": Material(0.06, "vehicle"),
    "paint_grey": Material(0.18, "vehicle"),
    "paint_blue": Material(0.22, "vehicle"),
    "paint_green": Material(0.28, "vehicle"),
    "paint_red": Material(0.35, "vehicle"),
    "paint_silver": Material(0.50, "vehicle"),
    "paint_yellow": Material(0.60, "vehicle"),
    "paint_white": Material(0.70, "vehicle"),
}

MATERIALS = {name: material.reflectivity for name, material in _MATERIALS.items()}
"""Material to reflectivity; common values of published reflectance tables, rounded."""

MATERIAL_ID = {name: index for index, name in enumerate(MATERIALS)}

REFLECTIVITY = np.array(list(MATERIALS.values()), dtype=np.float32)
"""Reflectivity (number of materials,) by material id."""

RETROREFLECTIVE: npt.NDArray[np.bool_] = np.array([m.retroreflective for m in _MATERIALS.values()])
"""Whether a material (number of materials,) is retroreflective: plates, signs, lamps."""

TRANSMITTANCE = np.array([m.transmittance for m in _MATERIALS.values()], dtype=np.float32)
"""Two-way share of light (number of materials,) that passes a pane; 0 for an opaque material."""

SEMANTIC = np.array([SEMANTIC_CLASSES.index(m.semantic) for m in _MATERIALS.values()], dtype=np.uint8)
"""Index into `SEMANTIC_CLASSES` (number of materials,) by material id."""
