"""How ETSI's common data dictionary codes the quantities that only CPMs have; see `quantities.py`."""

from __future__ import annotations

import math

from advpipe.pipeline.v2x.codec.quantities import CamQuantity

_PER_DEGREE = 180 / math.pi

COORDINATE = CamQuantity("coordinate of an object in metres", 100, -131_071, 131_070, clamp=True)
COORDINATE_CONFIDENCE = CamQuantity(
    "confidence of a coordinate in metres", 100, 1, 4094, 4096, beyond=4095, ceil=True
)
VELOCITY = CamQuantity("component of a velocity in m/s", 100, -16_382, 16_381, 16_383, clamp=True)
ANGLE = CamQuantity("angle from east in radians", 10 * _PER_DEGREE, 0, 3599, 3601, cycle=3600)
ANGLE_CONFIDENCE = CamQuantity(
    "confidence of an angle in radians", 10 * _PER_DEGREE, 1, 125, 127, beyond=126, ceil=True
)
DIMENSION = CamQuantity("size of an object in metres", 10, 1, 254, 256, beyond=255, ceil=True)
DIMENSION_CONFIDENCE = CamQuantity("confidence of a size in metres", 10, 1, 30, 32, beyond=31, ceil=True)
RANGE = CamQuantity("range of a sensor in metres", 10, 0, 4095, clamp=True)
