"""The section `simulation`: the seed, the clock and the duration."""

from __future__ import annotations

from datetime import datetime, timezone

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import DriveTimeS, StepS
from advpipe.pipeline.core.section import NotNegative, Section, Whole


class Simulation(Section):
    """The seed, the clock and the duration."""

    seed: Whole = Field(
        1, ge=0, lt=2**63, description="seed from which every random draw of the drive derives"
    )
    duration_s: DriveTimeS = Field(20.0, description="length of the recording in simulated seconds")
    step_s: StepS = Field(0.1, description="step of the V2X clock, which traffic and sensors follow")
    warmup_s: NotNegative = Field(
        15.0, le=86_400, description="time that is simulated before the recording starts"
    )
    start: datetime = Field(
        datetime(2026, 1, 1, 12, tzinfo=timezone.utc),
        description="simulated date and time of the start of the recording, with a time zone",
    )

    @model_validator(mode="after")
    def _clock(self) -> Simulation:
        step_ms = self.step_s * 1000
        if round(step_ms) < 1 or abs(step_ms - round(step_ms)) > 1e-6:
            raise ValueError(
                f"step_s {self.step_s:g} is not a whole number of milliseconds, SUMO's resolution"
            )
        if self.duration_s < self.step_s:
            raise ValueError(f"duration_s {self.duration_s:g} is shorter than one step_s {self.step_s:g}")
        if self.start.tzinfo is None:
            raise ValueError("start has no time zone; write it like 2026-01-01T12:00:00Z")
        if not 2000 <= self.start.year <= 2037:  # a ROS time stamp ends in January 2038
            raise ValueError(f"start is in {self.start.year}; it must be between 2000 and 2037")
        return self

    @property
    def frames(self) -> int:
        """The number of recorded steps."""
        return round(self.duration_s / self.step_s)

    @property
    def start_ns(self) -> int:
        """The start in nanoseconds since 1970."""
        return int(self.start.timestamp()) * 1_000_000_000 + self.start.microsecond * 1000

    def stamp_ns(self, frame: int) -> int:
        """The time stamp of a recorded frame in nanoseconds since 1970, exact to the nanosecond."""
        return self.start_ns + frame * round(self.step_s * 1e9)
