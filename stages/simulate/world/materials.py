"""What surfaces send back to a LiDAR at 905 nm: diffuse reflectivity in [0, 1]."""

from __future__ import annotations

import numpy as np

MATERIALS = {
    "asphalt": 0.14,
    "marking": 0.75,
    "concrete": 0.35,
    "grass": 0.42,
    "masonry": 0.45,
    "plaster": 0.60,
    "glass": 0.06,
    "foliage": 0.50,
    "bark": 0.30,
    "steel": 0.40,
    "sign": 0.95,
    "rubber": 0.05,
    "plastic": 0.12,
    "plate": 0.95,
    "cloth": 0.40,
    "skin": 0.50,
    "paint_black": 0.08,
    "paint_blue": 0.22,
    "paint_red": 0.35,
    "paint_silver": 0.50,
    "paint_white": 0.70,
}
"""Material to reflectivity; common values of published reflectance tables, rounded."""

PAINTS = tuple(name for name in MATERIALS if name.startswith("paint_"))

MATERIAL_ID = {name: index for index, name in enumerate(MATERIALS)}

REFLECTIVITY = np.array(list(MATERIALS.values()), dtype=np.float32)
"""Reflectivity (number of materials,) by material id."""
