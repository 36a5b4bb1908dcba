"""The weather, in the section `environment` of the scenario file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.section import NotNegative, Positive, Section

LEAST_RATE_MM_PER_H = 0.0001
"""Minimum rate of rain and snow: less is far below what can be measured; use clear weather instead."""


class Weather(Section):
    """Rain and snow by their rate, fog by its visibility; constant for the whole drive.

    Rain and snow act on LiDARs as in LISA (Kilic et al. 2021), fog as in Hahner et al. (ICCV 2021).
    """

    kind: Literal["clear", "rain", "fog", "snow"] = "clear"
    rate_mm_per_h: NotNegative = Field(0.0, le=200, description="rate of rain, or of snow as melted water")
    visibility_m: Positive = Field(1e5, ge=5, le=1e5, description="meteorological optical range in fog")

    @model_validator(mode="after")
    def _strength(self) -> Weather:
        if self.kind in ("rain", "snow") and self.rate_mm_per_h < LEAST_RATE_MM_PER_H:
            raise ValueError(f"{self.kind} needs its rate_mm_per_h, of at least {LEAST_RATE_MM_PER_H:g}")
        if self.kind == "fog" and self.visibility_m > 1000:
            raise ValueError("fog needs its visibility_m, of at most 1000")
        if self.kind in ("clear", "fog") and self.rate_mm_per_h:
            raise ValueError(f"rate_mm_per_h is given, but kind is {self.kind}; make it rain or snow")
        if self.kind != "fog" and self.visibility_m < 1e5:
            raise ValueError(f"visibility_m is given, but kind is {self.kind}; make it fog")
        return self
