"""The section `v2x`: who sends, the radio between them, and what receivers keep."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from advpipe.pipeline.core.bounds import AirDelayS, AntennaM, BitrateMbps, KeptS, SnapshotRateHz
from advpipe.pipeline.core.section import (
    Implementation,
    NotNegative,
    Number,
    Positive,
    Probability,
    Section,
    Switch,
    Whole,
)

CHANNEL_BITRATES_MBPS = (3.0, 4.5, 6.0, 9.0, 12.0, 18.0, 24.0, 27.0)
"""Of OFDM in a channel of 10 MHz (IEEE 802.11-2016, table 17-4); in proportion for other widths."""


class Shadowing(Section):
    """Log-normal shadowing, drawn anew for each message and receiver."""

    near_stddev_db: NotNegative = Field(5.6, le=20, description="up to the critical distance")
    far_stddev_db: NotNegative = Field(8.1, le=20, description="beyond the critical distance")


class Radio(Section):
    """ITS-G5: the broadcast radio of IEEE 802.11p. The defaults are 6 Mbit/s in a channel of 10 MHz.

    Dual slope, shadowing and fading are those that Cheng et al. (IEEE JSAC 25(8), 2007) measured between
    vehicles at 5.9 GHz.
    """

    transmit_power_dbm: Number = Field(23.0, ge=-30, le=44, description="with the antenna's gain")
    frequency_hz: Number = Field(5.9e9, ge=0.7e9, le=6e9)
    bandwidth_mhz: Literal[5, 10, 20] = 10
    bitrate_mbps: BitrateMbps = Field(
        6.0, description="one of OFDM's, like 3, 6 or 12 in a channel of 10 MHz"
    )
    noise_dbm: Number = Field(-98.0, ge=-130, le=-40, description="thermal noise and the receiver's own")
    sensitivity_dbm: Number = Field(-95.0, ge=-130, le=-30, description="weaker messages are not noticed")
    carrier_sense_dbm: Number = Field(
        -85.0, ge=-130, le=-30, description="stronger signals make the channel busy"
    )
    snir_threshold_db: Number = Field(
        0.0, ge=-20, le=60, description="lost below this ratio to noise and interference"
    )
    capture_threshold_db: Number = Field(
        6.0, ge=0, le=60, description="that a later message needs over the one being received"
    )
    path_loss: Literal["free_space", "dual_slope"] = "dual_slope"
    near_exponent: Number = Field(2.0, ge=1, le=8, description="dual slope: up to the critical distance")
    far_exponent: Number = Field(4.0, ge=1, le=8, description="dual slope: beyond the critical distance")
    critical_distance_m: Number = Field(100.0, ge=1, le=1e4)
    shadowing: Shadowing | None = Field(Shadowing(), description="null for none")
    fading: Literal["none", "nakagami"] = "nakagami"
    building_loss: Literal["none", "obstacles"] = Field(
        "none", description="obstacles: by walls crossed and metres inside (Sommer et al. 2011)"
    )
    wall_loss_db: NotNegative = Field(9.0, le=100, description="for each wall crossed")
    inside_loss_db_per_m: NotNegative = Field(0.4, le=100, description="for each metre inside")
    interference: Switch = Field(True, description="messages on the air at once disturb each other")
    overhead_bytes: Whole = Field(
        82, ge=0, le=2000, description="of BTP, GeoNetworking, LLC and MAC around each CAM, without security"
    )
    processing_delay_min_s: NotNegative = Field(
        0.0, le=1.0, description="in the receiver, besides channel access, air time and propagation"
    )
    processing_delay_max_s: NotNegative = Field(0.0, le=1.0)
    queue_delay_max_s: AirDelayS = Field(
        1.0, description="a message that waits longer for the channel is dropped"
    )
    antenna_height_m: AntennaM = Field(1.5, description="above the ground")

    @model_validator(mode="after")
    def _combinations(self) -> Radio:
        rates = [rate * self.bandwidth_mhz / 10 for rate in CHANNEL_BITRATES_MBPS]
        if self.bitrate_mbps not in rates:
            known = ", ".join(f"{rate:g}" for rate in rates)
            raise ValueError(
                f"bitrate_mbps {self.bitrate_mbps:g} is none of a {self.bandwidth_mhz} MHz channel ({known})"
            )
        if self.processing_delay_min_s > self.processing_delay_max_s:
            raise ValueError(
                f"processing_delay_min_s {self.processing_delay_min_s:g} is above processing_delay_max_s "
                f"{self.processing_delay_max_s:g}"
            )
        return self


class CamRules(Section):
    """When stations send CAMs (EN 302 637-2, 6.1.3)."""

    min_interval_s: Positive = Field(0.1, ge=0.05, le=10)
    max_interval_s: Positive = Field(1.0, ge=0.05, le=10)
    heading_deg: NotNegative = Field(4.0, le=180, description="turned by more: a new CAM")
    position_m: NotNegative = Field(4.0, le=1000, description="moved by more: a new CAM")
    speed_mps: NotNegative = Field(0.5, le=100, description="faster or slower by more: a new CAM")
    low_frequency_interval_s: NotNegative = Field(
        0.5, le=60, description="between CAMs with the low-frequency container"
    )
    path_points: Whole = Field(23, ge=0, le=23, description="of the path history")
    dcc: Literal["none", "reactive"] = Field(
        "reactive", description="decentralised congestion control (TS 102 687) stretches the interval"
    )

    @model_validator(mode="after")
    def _order(self) -> CamRules:
        if self.min_interval_s > self.max_interval_s:
            raise ValueError(
                f"min_interval_s {self.min_interval_s:g} is above max_interval_s {self.max_interval_s:g}"
            )
        return self


class SelfKnowledge(Section):
    """How well stations without instruments of ours know themselves: truth plus noise.

    The instrumented vehicles send their on-board estimate.
    """

    position_stddev_m: NotNegative = Field(0.5, le=100, description="of each horizontal axis")
    heading_stddev_deg: NotNegative = Field(0.5, le=180)
    speed_stddev_mps: NotNegative = Field(0.1, le=50)


class LdmRules(Section):
    """The Local Dynamic Map of each instrumented vehicle."""

    expiry_s: KeptS = Field(1.1, description="a CAM is kept until so long after its generation")
    rate_hz: SnapshotRateHz | None = Field(
        None, description="at which it is recorded; every simulation.step_s if left out"
    )
    keep: Literal["newest", "latest"] = Field(
        "newest",
        description="of one station: the CAM generated last, or, as Artery does, the one received last",
    )


class V2x(Section):
    """Vehicle-to-everything messages: ETSI's CAMs over ITS-G5."""

    enabled: Switch = True
    network: Implementation = Field(
        "embedded", description="who hears what: embedded, or module:Class of your own"
    )
    penetration: Probability = Field(
        0.5, description="share of the vehicles that send; instrumented ones always do"
    )
    radio: Radio = Radio()
    cam: CamRules = CamRules()
    others: SelfKnowledge = SelfKnowledge()
    ldm: LdmRules = LdmRules()

    def is_ldm_due(self, frame: int, step_s: float) -> bool:
        """Whether Local Dynamic Maps are recorded at this frame."""
        every = 1 if self.ldm.rate_hz is None else round(1 / (self.ldm.rate_hz * step_s))
        return self.enabled and frame % every == 0
