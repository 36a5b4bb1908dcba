"""What can be measured of a GNSS fix that an attack changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.quantity import Quantity


@dataclass(frozen=True)
class FixChange:
    """An attacked fix: the false position minus the true one (3,), east, north and up in metres."""

    offset_m: Float64


FIX_DISPLACEMENT = Quantity[FixChange](
    "fix_displacement_m",
    "m",
    "distance between the false and the true fix",
    lambda change: float(np.linalg.norm(change.offset_m)),
)
FIX_HEIGHT_CHANGE = Quantity[FixChange](
    "fix_height_change_m",
    "m",
    "absolute change of a fix's height",
    lambda change: abs(float(change.offset_m[2])),
)

FIX_QUANTITIES: Mapping[str, Quantity[FixChange]] = {
    quantity.name: quantity for quantity in (FIX_DISPLACEMENT, FIX_HEIGHT_CHANGE)
}
