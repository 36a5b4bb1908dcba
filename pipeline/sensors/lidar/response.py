"""From the signal of a return to the intensity that a sensor reports."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydantic import Field

from advpipe.pipeline.core.section import Number, Probability, Section, Whole

Float32 = npt.NDArray[np.float32]


class IntensityResponse(Section):
    """intensity = scale x signal^exponent, at most 1, in `levels` steps; 0 for signals below a threshold.

    The signal is 1 for a white diffuse target at normal incidence. The threshold at range r is
    `threshold` x (1 + (r / threshold_range_m)^2): weak returns are still ranged, but report no intensity.
    The default reports the signal itself: calibrated reflectivity.
    """

    scale: Number = Field(1.0, ge=0.01, le=100, description="intensity of a signal of 1")
    exponent: Number = Field(1.0, ge=0.05, le=4, description="below 1, weak signals are raised")
    threshold: Probability = Field(0.0, description="signal below which the intensity is 0, at short range")
    threshold_range_m: Number = Field(
        100.0, ge=1, le=1000, description="range at which the threshold has doubled"
    )
    levels: Whole = Field(0, ge=0, le=65_535, description="steps of the intensity from 0 to 1; 0: continuous")

    @property
    def is_linear(self) -> bool:
        """Whether the intensity is the signal itself, up to 1."""
        return self.scale == 1 and self.exponent == 1 and self.threshold == 0 and self.levels == 0

    def intensity(self, signal: Float32, range_m: Float32) -> Float32:
        """Intensity (N,) in [0, 1] of signals (N,) from ranges (N,)."""
        if self.is_linear:
            return np.minimum(signal, 1)
        reported: Float32 = np.log(np.maximum(signal, np.float32(1e-9)))  # faster than a power
        reported *= np.float32(self.exponent)
        reported += np.float32(np.log(self.scale))
        np.exp(reported, out=reported)
        np.minimum(reported, 1, out=reported)
        if self.threshold:
            least = 1 + np.square(range_m * np.float32(1 / self.threshold_range_m))
            reported[signal < np.float32(self.threshold) * least] = 0
        if self.levels:
            reported *= np.float32(self.levels)
            np.rint(reported, out=reported)
            reported *= np.float32(1 / self.levels)
        return reported
