"""What stations do beside CAMs, as a scenario sets it in `v2x`: warnings, and changes of pseudonyms."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.section import NotNegative, Number, Positive, Section, Whole


class DenmRules(Section):
    """The DEN basic service (EN 302 637-3): what stations warn of, and how often."""

    stopped_s: Positive = Field(
        10.0, ge=0.1, le=3600, description="time for which a vehicle has stood when it warns of itself"
    )
    braking_mps2: Positive = Field(
        7.0, ge=0.1, le=20, description="deceleration from which a vehicle warns of its braking"
    )
    braking_from_mps: NotNegative = Field(
        5.6, le=100, description="speed from which it does, when it begins to brake"
    )
    time_to_collision_s: Positive = Field(
        1.5, ge=0.1, le=30, description="time to a collision with a vehicle ahead below which it warns"
    )
    repetition_s: Positive = Field(
        0.5, ge=0.05, le=10, description="time between two DENMs about the same event"
    )
    validity_s: Whole = Field(
        10, ge=1, le=86_400, description="time for which a DENM is valid after its state of the event"
    )


class PseudonymRules(Section):
    """When stations change their pseudonym: station id, certificate, MAC address and sequence numbers
    together, and begin a new path history (ETSI TR 103 415)."""

    strategy: Literal["period", "distance", "silent_period", "vehicle_centric"] = Field(
        "period",
        description="period: after a time; distance: after a way; silent_period: after a time, with a "
        "silence before the new one; vehicle_centric: at the first manoeuvre after a time",
    )
    period_s: Positive = Field(
        60.0, ge=0.1, le=86_400, description="time for which a pseudonym is used, on average"
    )
    distance_m: Positive = Field(
        800.0, ge=1, le=1e6, description="way for which a pseudonym is used, on average"
    )
    variation: Number = Field(
        0.2, ge=0, le=0.99, description="share by which each use is drawn longer or shorter"
    )
    silent_min_s: NotNegative = Field(3.0, le=600, description="shortest silence of silent_period")
    silent_max_s: NotNegative = Field(13.0, le=600, description="longest silence of silent_period")
    heading_deg: Number = Field(
        20.0, ge=0.1, le=180, description="turn that is a manoeuvre of vehicle_centric"
    )
    speed_mps: Positive = Field(3.0, ge=0.1, le=100, description="change of the speed that is one")

    @model_validator(mode="after")
    def _order(self) -> PseudonymRules:
        if self.silent_min_s > self.silent_max_s:
            raise ValueError(
                f"silent_min_s {self.silent_min_s:g} is above silent_max_s {self.silent_max_s:g}"
            )
        return self

    @property
    def longest_silence_s(self) -> float:
        """For how long at most a station sends nothing before its next pseudonym."""
        return self.silent_max_s if self.strategy == "silent_period" else 0.0
