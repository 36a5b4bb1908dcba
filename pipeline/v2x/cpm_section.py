"""The key `v2x.cpm`: which stations send collective perception messages (CPMs), and of what."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from advpipe.pipeline.core.section import (
    NotNegative,
    Number,
    Positive,
    Probability,
    Reference,
    Section,
    Whole,
)

PerceptionM = Annotated[Number, Field(ge=5, le=400)]
"""Range of a vehicle's sensors: a CPM states at most 409.5 m."""


class CpmRules(Section):
    """The stations' collective perception service (TS 103 324, 6.1) and their perception."""

    penetration: Probability = Field(
        1.0, description="share of the stations that send CPMs; instrumented vehicles always do"
    )
    range_m: PerceptionM = Field(80.0, description="range within which a station perceives road users")
    detector: Reference | None = Field(
        None,
        description="detector on the clouds of instrumented vehicles, whose CPMs then hold what it finds; "
        "null: the true road users that their sensors reach, with errors, as for all others",
    )
    min_score: Probability = Field(0.3, description="score from which a detection is an object")
    position_stddev_m: NotNegative = Field(
        0.2, le=20, description="standard deviation of a perceived position along each horizontal axis"
    )
    speed_stddev_mps: NotNegative = Field(
        0.1, le=20, description="standard deviation of a perceived velocity along each horizontal axis"
    )
    heading_stddev_deg: NotNegative = Field(
        1.0, le=180, description="standard deviation of a perceived heading"
    )
    min_interval_s: Positive = Field(
        0.1, ge=0.1, le=10, description="T_GenCpmMin: shortest time between two CPMs of a station"
    )
    max_interval_s: Positive = Field(
        1.0,
        ge=0.1,
        le=10,
        description="T_GenCpmMax: time after which a perceived object is included again; half of it for "
        "pedestrians and cyclists",
    )
    position_m: NotNegative = Field(
        4.0, le=1000, description="change of an object's position above which it is included again"
    )
    speed_mps: NotNegative = Field(
        0.5, le=100, description="change of an object's speed above which it is included again"
    )
    heading_deg: NotNegative = Field(
        4.0, le=180, description="change of an object's direction of motion above which it is included again"
    )
    sensor_interval_s: Positive = Field(
        1.0, ge=0.1, le=60, description="T_AddSensorInformation: time between CPMs with sensor information"
    )
    max_objects: Whole = Field(
        24, ge=1, le=128, description="objects in a CPM; the nearest come first, others wait for the next"
    )
    kept_s: Positive = Field(
        1.5, ge=0.1, le=60, description="time for which a Local Dynamic Map keeps an object heard of"
    )

    @model_validator(mode="after")
    def _order(self) -> CpmRules:
        if self.min_interval_s > self.max_interval_s:
            raise ValueError(
                f"min_interval_s {self.min_interval_s:g} is above max_interval_s {self.max_interval_s:g}"
            )
        return self
