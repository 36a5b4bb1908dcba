"""Intensities that a source gives as bytes, 0 to 255."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.option_names import option_name

STRONGEST = 255


def check_intensity(file: Path, intensity: npt.NDArray[np.floating[Any]], source: str) -> None:
    """Raises AdvpipeError for intensities (N,), N > 0, on another scale than 0 to 255; source: for people."""
    low, high = float(intensity.min()), float(intensity.max())
    if not 0 <= low <= high <= STRONGEST:
        raise AdvpipeError(
            f"{file}: intensities from {low:g} to {high:g}, where {source} has 0 to {STRONGEST}; its points "
            f"have other columns, or another scale ({option_name('scale_intensity')})"
        )
