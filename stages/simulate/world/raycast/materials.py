"""Materials: how surfaces reflect and transmit a LiDAR's light at 905 nm, how they look, and their class."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt


class Material(NamedTuple):
    """`reflectivity`: diffuse, in [0, 1]. `semantic`: one of `SEMANTIC_CLASSES`.

    `retroreflective`: whether it reflects most light back to its source. `transmittance`: the two-way share
    of light that passes a pane; 0 for an opaque material. `clarity`: the same of visible light, where it
    differs. `colour`: of visible light, in sRGB. `texture`: a key of `textures.TEXTURES`. `specular`: share
    of light that a smooth surface reflects at normal incidence.
    """

    reflectivity: float
    semantic: str
    retroreflective: bool = False
    transmittance: float = 0.0
    colour: str = ""
    texture: str = "plain"
    specular: float = 0.0
    clarity: float | None = None


SEMANTIC_CLASSES = (
    "road", "marking", "pavement", "ground", "vegetation", "building", "pole", "sign", "barrier",
    "vehicle", "person", "other",
)  # fmt: skip

_MATERIALS = {
    "asphalt": Material(0.14, "road", colour="#6a6a6c", texture="grain"),
    "asphalt_new": Material(0.08, "road", colour="#4a4a4d", texture="grain"),
    "asphalt_old": Material(0.21, "road", colour="#807d79", texture="grain"),
    "marking": Material(0.75, "marking", colour="#e6e6e2", texture="worn"),
    "marking_worn": Material(0.45, "marking", colour="#c4c3bd", texture="worn"),
    "concrete": Material(0.35, "pavement", colour="#a9a59e", texture="slabs"),
    "paving": Material(0.30, "pavement", colour="#98928c", texture="paving"),
    "kerbstone": Material(0.40, "pavement", colour="#a6a39d", texture="stone"),
    "grass": Material(0.42, "ground", colour="#66793f", texture="grass"),
    "soil": Material(0.25, "ground", colour="#7a6248", texture="grass"),
    "tall_grass": Material(0.45, "vegetation", colour="#7f8748", texture="leaves"),
    "foliage": Material(0.50, "vegetation", colour="#4d6b34", texture="leaves"),
    "conifer": Material(0.40, "vegetation", colour="#37552f", texture="leaves"),
    "bark": Material(0.30, "vegetation", colour="#64513f", texture="bark"),
    "masonry": Material(0.45, "building", colour="#8f6a5a", texture="bricks"),
    "plaster": Material(0.60, "building", colour="#dccfb8", texture="plaster"),
    "roof_tile": Material(0.38, "building", colour="#86584a", texture="tiles"),
    "facade_dark": Material(0.20, "building", colour="#5b5f66", texture="plaster"),
    "facade_concrete": Material(0.35, "building", colour="#b3b0a8", texture="plaster"),
    "room": Material(0.30, "building", colour="#544d45"),
    "room_light": Material(0.55, "building", colour="#8d8478"),
    "curtain": Material(0.55, "building", colour="#d8d2c6"),
    "door": Material(0.28, "building", colour="#5f4433", texture="bark"),
    "frame_white": Material(0.62, "building", colour="#e4e2dc"),
    "pane": Material(0.10, "building", transmittance=0.55, colour="#1d2a30", specular=0.08),
    "glass": Material(0.10, "vehicle", transmittance=0.20, clarity=0.80, colour="#18211f", specular=0.06),
    "glass_tinted": Material(
        0.10, "vehicle", transmittance=0.04, clarity=0.50, colour="#0c1012", specular=0.06
    ),
    "steel": Material(0.40, "pole", colour="#8b9094", specular=0.04),
    "wood": Material(0.45, "other", colour="#8a6a47", texture="bark"),
    "rail": Material(0.45, "barrier", colour="#9ea4a8", specular=0.06),
    "barrier_concrete": Material(0.40, "barrier", colour="#b5b1a8", texture="grain"),
    "fence": Material(0.42, "barrier", colour="#8d7357", texture="bark"),
    "fence_metal": Material(0.25, "barrier", colour="#3c4743", specular=0.03),
    "garden_wall": Material(0.40, "barrier", colour="#97897a", texture="bricks"),
    "noise_barrier": Material(0.33, "barrier", colour="#7d8b80", texture="slabs"),
    "hazard_board": Material(0.62, "barrier", colour="#c8452f"),
    "wire": Material(0.12, "pole", colour="#2a2a2b"),
    "sign": Material(0.95, "sign", retroreflective=True, colour="#f2f2f0"),
    "sign_back": Material(0.35, "sign", colour="#8f9396"),
    "plate": Material(0.85, "vehicle", retroreflective=True, colour="#f4f4f0"),
    "lamp": Material(0.60, "vehicle", retroreflective=True, colour="#d9dde0", specular=0.06),
    "rubber": Material(0.05, "vehicle", colour="#1c1c1d"),
    "rim": Material(0.45, "vehicle", colour="#a4a8ac", specular=0.3),
    "plastic": Material(0.12, "vehicle", colour="#242628", specular=0.02),
    "interior": Material(0.06, "vehicle", colour="#2b2926"),
    "frame": Material(0.35, "vehicle", colour="#55585c", specular=0.03),
    "tarpaulin": Material(0.55, "vehicle", colour="#c9cdd2", specular=0.02),
    "cloth": Material(0.40, "person", colour="#7d7f8c"),
    "cloth_dark": Material(0.15, "person", colour="#2f3340"),
    "skin": Material(0.50, "person", colour="#c99a7c"),
    "bin": Material(0.20, "other", colour="#3d4a3f", specular=0.02),
    "paint_black": Material(0.03, "vehicle", colour="#111214", specular=0.05),
    "paint_grey": Material(0.15, "vehicle", colour="#53575c", specular=0.05),
    "paint_blue": Material(0.15, "vehicle", colour="#1d3f7d", specular=0.05),
    "paint_green": Material(0.20, "vehicle", colour="#2c5a40", specular=0.05),
    "paint_brown": Material(0.18, "vehicle", colour="#4a362a", specular=0.05),
    "paint_red": Material(0.45, "vehicle", colour="#9c1c1c", specular=0.05),
    "paint_silver": Material(0.45, "vehicle", colour="#b4b8bc", specular=0.05),
    "paint_yellow": Material(0.60, "vehicle", colour="#d9a916", specular=0.05),
    "paint_white": Material(0.75, "vehicle", colour="#eceeee", specular=0.05),
    # As plastic, fence and rail above, but for CARLA's tags.
    "signal_head": Material(0.12, "vehicle", colour="#242628", specular=0.02),
    "planks": Material(0.42, "barrier", colour="#8d7357", texture="bark"),
    "skip": Material(0.45, "barrier", colour="#9ea4a8", specular=0.06),
}

MATERIALS = {name: material.reflectivity for name, material in _MATERIALS.items()}
"""Material to reflectivity; common values of published reflectance tables, rounded.

Carbon black absorbs 905 nm as it does visible light: black paint returns 2 to 6 %, and grey, blue, green and
brown paints are toned with it. Panes of vehicles are green, heat-absorbing glass: its iron (Fe2+, absorbing
about 1 um) passes some 45 % of 905 nm each way, where regulation ECE 43 asks for 70 % of visible light;
privacy glass passes 20 %.
"""

MATERIAL_ID = {name: index for index, name in enumerate(MATERIALS)}

REFLECTIVITY = np.array(list(MATERIALS.values()), dtype=np.float32)
"""Reflectivity (number of materials,) by material id."""

RETROREFLECTIVE: npt.NDArray[np.bool_] = np.array([m.retroreflective for m in _MATERIALS.values()])
"""Whether a material (number of materials,) is retroreflective: plates, signs, lamps."""

TRANSMITTANCE = np.array([m.transmittance for m in _MATERIALS.values()], dtype=np.float32)
"""Two-way share of light (number of materials,) that passes a pane; 0 for an opaque material."""

CLARITY = np.array(
    [m.transmittance if m.clarity is None else m.clarity for m in _MATERIALS.values()], np.float32
)
"""Two-way share of visible light (number of materials,) that passes a pane."""

SEMANTIC = np.array([SEMANTIC_CLASSES.index(m.semantic) for m in _MATERIALS.values()], dtype=np.uint8)
"""Index into `SEMANTIC_CLASSES` (number of materials,) by material id."""

_CODED = np.array([[int(m.colour[i : i + 2], 16) for i in (1, 3, 5)] for m in _MATERIALS.values()]) / 255.0

COLOUR: npt.NDArray[np.float32] = np.where(
    _CODED > 0.04045, ((_CODED + 0.055) / 1.055) ** 2.4, _CODED / 12.92
).astype(np.float32)
"""Linear colour (number of materials, 3) of visible light by material id (IEC 61966-2-1)."""

SPECULAR = np.array([m.specular for m in _MATERIALS.values()], dtype=np.float32)
"""Reflectance of a smooth surface at normal incidence (number of materials,) by material id."""

TEXTURE = tuple(m.texture for m in _MATERIALS.values())
"""Key of `textures.TEXTURES` by material id."""
BY_TEXTURE = np.array(sorted(range(len(TEXTURE)), key=lambda each: (TEXTURE[each], each)), np.uint8)
"""All materials, so that those of one texture follow one another."""
