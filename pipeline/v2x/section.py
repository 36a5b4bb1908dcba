"""The section `v2x`: the sending stations, the radio, and the Local Dynamic Maps of receivers."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

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
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.message_type import CAM, CPM, DENM, MessageType
from advpipe.pipeline.v2x.station_section import DenmRules as DenmRules
from advpipe.pipeline.v2x.station_section import PseudonymRules as PseudonymRules

CHANNEL_BITRATES_MBPS = (3.0, 4.5, 6.0, 9.0, 12.0, 18.0, 24.0, 27.0)
"""Bitrates of OFDM in a channel of 10 MHz (IEEE 802.11-2016, table 17-4); they scale with the bandwidth."""


def _recorded(section: Section, tree: dict[str, Any], **unused: object) -> dict[str, Any]:
    """The tree of a section without keys that came later and have these values: older drives are recorded
    with the same bytes."""
    return {
        key: each for key, each in tree.items() if key not in unused or getattr(section, key) != unused[key]
    }


class Shadowing(Section):
    """Log-normal shadowing, drawn anew for each message and receiver unless it has a correlation distance."""

    near_stddev_db: NotNegative = Field(
        5.6, le=20, description="standard deviation up to the critical distance"
    )
    far_stddev_db: NotNegative = Field(
        8.1, le=20, description="standard deviation beyond the critical distance"
    )
    correlation_distance_m: Number | None = Field(
        None,
        ge=0.1,
        le=1e4,
        description="distance over which the autocorrelation falls to 1/e when one end of a link moves "
        "(Gudmundson 1991); null: drawn anew for each message and receiver",
    )

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return _recorded(self, handler(self), correlation_distance_m=None)


class Radio(Section):
    """The ITS-G5 radio, IEEE 802.11p in broadcast mode. By default 6 Mbit/s in a channel of 10 MHz.

    Dual slope, shadowing and fading are those that Cheng et al. (IEEE JSAC 25(8), 2007) measured between
    vehicles at 5.9 GHz.
    """

    transmit_power_dbm: Number = Field(
        23.0, ge=-30, le=44, description="transmit power, including the antenna's gain"
    )
    frequency_hz: Number = Field(5.9e9, ge=0.7e9, le=6e9, description="carrier frequency")
    bandwidth_mhz: Literal[5, 10, 20] = 10
    bitrate_mbps: BitrateMbps = Field(
        6.0, description="a bitrate of OFDM, such as 3, 6 or 12 in a channel of 10 MHz"
    )
    noise_dbm: Number = Field(
        -98.0, ge=-130, le=-40, description="noise power at the receiver, thermal and its own"
    )
    sensitivity_dbm: Number = Field(
        -95.0, ge=-130, le=-30, description="received power below which messages are not detected"
    )
    carrier_sense_dbm: Number = Field(
        -85.0, ge=-130, le=-30, description="received power from which a station senses the channel as busy"
    )
    snir_threshold_db: Number = Field(
        0.0, ge=-20, le=60, description="signal to noise and interference ratio below which messages are lost"
    )
    capture_threshold_db: Number = Field(
        6.0,
        ge=0,
        le=60,
        description="power by which a later message must exceed the one being received to capture the "
        "receiver",
    )
    path_loss: Literal["free_space", "dual_slope"] = "dual_slope"
    near_exponent: Number = Field(
        2.0, ge=1, le=8, description="exponent of dual_slope up to the critical distance"
    )
    far_exponent: Number = Field(
        4.0, ge=1, le=8, description="exponent of dual_slope beyond the critical distance"
    )
    critical_distance_m: Number = Field(
        100.0, ge=1, le=1e4, description="distance at which dual_slope and shadowing change"
    )
    shadowing: Shadowing | None = Field(Shadowing(), description="log-normal shadowing; null: none")
    fading: Literal["none", "nakagami"] = "nakagami"
    building_loss: Literal["none", "obstacles"] = Field(
        "none",
        description="obstacles: loss by walls crossed and metres inside buildings (Sommer et al. 2011)",
    )
    wall_loss_db: NotNegative = Field(9.0, le=100, description="loss for each wall crossed")
    inside_loss_db_per_m: NotNegative = Field(
        0.4, le=100, description="loss for each metre inside a building"
    )
    vehicle_loss: Literal["none", "knife_edge"] = Field(
        "none",
        description="knife_edge: loss by the vehicles with a radio that stand between two antennas "
        "(ITU-R P.526, Boban et al. 2011)",
    )
    interference: Switch = Field(True, description="simultaneous messages interfere with each other")
    overhead_bytes: Whole = Field(
        82,
        ge=0,
        le=2000,
        description="bytes of BTP, GeoNetworking, LLC and MAC around each CAM, without security",
    )
    processing_delay_min_s: NotNegative = Field(
        0.0,
        le=1.0,
        description="shortest delay in the receiver, besides channel access, air time and propagation",
    )
    processing_delay_max_s: NotNegative = Field(0.0, le=1.0, description="longest delay in the receiver")
    queue_delay_max_s: AirDelayS = Field(
        1.0, description="time after which a message that waits for the channel is dropped"
    )
    antenna_height_m: AntennaM = Field(1.5, description="height of the antennas above the ground")

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

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return _recorded(self, handler(self), vehicle_loss="none")


class CamRules(Section):
    """The rules by which stations generate CAMs (EN 302 637-2, 6.1.3)."""

    min_interval_s: Positive = Field(
        0.1, ge=0.05, le=10, description="shortest time between two CAMs of a station"
    )
    max_interval_s: Positive = Field(
        1.0, ge=0.05, le=10, description="longest time between two CAMs of a station"
    )
    heading_deg: NotNegative = Field(
        4.0, le=180, description="change of the heading above which a CAM is sent"
    )
    position_m: NotNegative = Field(
        4.0, le=1000, description="change of the position above which a CAM is sent"
    )
    speed_mps: NotNegative = Field(0.5, le=100, description="change of the speed above which a CAM is sent")
    low_dynamics_cams: Whole = Field(
        3,
        ge=0,
        le=3,
        description="N_GenCam: CAMs in a row without a change of the vehicle's motion that repeat the last "
        "interval, before it returns to max_interval_s; 0: it always is max_interval_s",
    )
    low_frequency_interval_s: NotNegative = Field(
        0.5, le=60, description="shortest time between CAMs with the low-frequency container"
    )
    path_points: Whole = Field(23, ge=0, le=23, description="maximum number of points in the path history")
    dcc: Literal["none", "reactive", "adaptive"] = Field(
        "reactive",
        description="decentralised congestion control (TS 102 687), which lengthens the interval on a busy "
        "channel: by a table of states, or adaptively (LIMERIC)",
    )

    @model_validator(mode="after")
    def _order(self) -> CamRules:
        if self.min_interval_s > self.max_interval_s:
            raise ValueError(
                f"min_interval_s {self.min_interval_s:g} is above max_interval_s {self.max_interval_s:g}"
            )
        return self

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return _recorded(self, handler(self), low_dynamics_cams=3)


class SelfKnowledge(Section):
    """The noise in the CAMs of vehicles without instruments, which send their true state plus noise.

    The instrumented vehicles send their on-board estimate.
    """

    position_stddev_m: NotNegative = Field(
        0.5, le=100, description="standard deviation of the position along each horizontal axis"
    )
    heading_stddev_deg: NotNegative = Field(0.5, le=180, description="standard deviation of the heading")
    speed_stddev_mps: NotNegative = Field(0.1, le=50, description="standard deviation of the speed")


class LdmRules(Section):
    """The Local Dynamic Map of each instrumented vehicle."""

    expiry_s: KeptS = Field(1.1, description="time after its generation for which a CAM is kept")
    rate_hz: SnapshotRateHz | None = Field(
        None, description="rate at which the maps are recorded; by default every simulation.step_s"
    )
    keep: Literal["newest", "latest"] = Field(
        "newest",
        description="which CAM of a station is kept: the one generated last (newest), or, as in Artery, the "
        "one received last (latest)",
    )


class SecurityRules(Section):
    """What stations do by `security: etsi`: when they send certificates, and what they verify."""

    certificate_interval_s: NotNegative = Field(
        1.0,
        le=60,
        description="shortest time between messages with the certificate; others have its digest",
    )
    verification_time_s: NotNegative = Field(
        0.0, le=1, description="time that the verification of one signature takes in the receiver"
    )
    verification_queue: Whole = Field(
        64,
        ge=0,
        le=10_000,
        description="messages that may wait to be verified; more are rejected",
    )
    max_age_s: Positive = Field(
        2.0, ge=0.01, le=600, description="time after its signature for which a message is accepted"
    )
    clock_tolerance_s: NotNegative = Field(
        0.2, le=60, description="how far in the future a message may have been signed"
    )
    expired_share: Probability = Field(0.0, description="share of the stations whose tickets have expired")
    unpermitted_share: Probability = Field(
        0.0, description="share of the others whose tickets do not permit CAMs"
    )
    truncated_share: Probability = Field(0.0, description="share of the packets that are cut off when sent")
    expired_authority: Switch = Field(
        False, description="the certificates of the authority and the root have expired"
    )

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        shares = dict.fromkeys(("expired_share", "unpermitted_share", "truncated_share"), 0.0)
        return _recorded(self, handler(self), **shares, expired_authority=False)


class V2x(Section):
    """V2X (vehicle-to-everything) messages: ETSI's CAMs over ITS-G5."""

    enabled: Switch = Field(True, description="simulate V2X messages")
    network: Implementation = Field(
        "embedded",
        description="simulator of which station receives which message: embedded, artery, or module:Class "
        "of your own",
    )
    penetration: Probability = Field(
        0.5, description="share of the vehicles that send CAMs; instrumented vehicles always do"
    )
    radio: Radio = Radio()
    cam: CamRules = CamRules()
    denm: DenmRules | None = Field(
        None, description="warnings of stopped vehicles, hard braking and collision risks; null: none"
    )
    pseudonyms: PseudonymRules | None = Field(
        None, description="changes of pseudonyms; null: every station keeps its identity"
    )
    clock_error_s: NotNegative = Field(
        0.0, le=30, description="standard deviation of the error of each station's clock"
    )
    others: SelfKnowledge = SelfKnowledge()
    ldm: LdmRules = LdmRules()
    cpm: CpmRules | None = Field(
        None, description="collective perception: stations send CPMs with what they perceive; null: none do"
    )
    geonetworking: Switch = Field(
        False,
        description="record every packet with its GeoNetworking headers, and count its true bytes on the air",
    )
    security: Literal["none", "etsi"] = Field(
        "none",
        description="etsi: messages are signed, and receivers reject those that are not (TS 103 097), with "
        "geonetworking",
    )
    security_rules: SecurityRules = SecurityRules()

    @property
    def message_types(self) -> tuple[MessageType, ...]:
        """The types of messages that stations send."""
        further = ((DENM, self.denm), (CPM, self.cpm))
        return (CAM, *(kind for kind, rules in further if rules is not None))

    @property
    def has_packets(self) -> bool:
        """Whether messages have GeoNetworking headers and the envelopes inside them."""
        return self.geonetworking or self.security != "none"

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Drives without packets, security and DENMs are recorded as before there were any."""
        return _recorded(
            self,
            handler(self),
            cpm=None,
            geonetworking=False,
            security="none",
            security_rules=SecurityRules(),
            denm=None,
            pseudonyms=None,
            clock_error_s=0.0,
        )

    def is_ldm_due(self, frame: int, step_s: float) -> bool:
        """Whether Local Dynamic Maps are recorded at this frame."""
        every = 1 if self.ldm.rate_hz is None else round(1 / (self.ldm.rate_hz * step_s))
        return self.enabled and frame % every == 0
