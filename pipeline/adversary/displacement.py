"""Points moved by at most a reach."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.baselines import move_within
from advpipe.pipeline.geometry.lengths import lengths

Float32 = npt.NDArray[np.float32]

ROUNDING_MARGIN = 1e-9
"""Displacements are shortened by this fraction, so that rounding takes none beyond the reach."""


def displaced(points: Float32, offset_m: npt.NDArray[np.floating[Any]], reach_m: float) -> Float32:
    """Points (N, 4) moved by offsets (N, 3), never farther than the reach, even after rounding to float32."""
    offset = np.asarray(offset_m, np.float64)
    length = lengths(offset)[:, None]
    offset = offset * np.minimum(1.0, reach_m / np.maximum(length, 1e-300)) * (1 - ROUNDING_MARGIN)
    moved = points.copy()
    moved[:, :3] = move_within(points[:, :3], offset)
    return moved
