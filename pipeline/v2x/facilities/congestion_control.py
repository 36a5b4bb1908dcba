"""The congestion control that a scenario chooses."""

from __future__ import annotations

from typing import Protocol

from advpipe.pipeline.v2x.facilities.adaptive_dcc import AdaptiveDcc
from advpipe.pipeline.v2x.facilities.dcc import ReactiveDcc
from advpipe.pipeline.v2x.radio.ofdm import Ofdm
from advpipe.pipeline.v2x.section import V2x


class CongestionControl(Protocol):
    """Decentralised congestion control of one station (ETSI TS 102 687)."""

    def update(self, channel_load: float) -> None:
        """Process the share of the last 0.1 s in which the channel was busy."""

    def sent(self, cam_bytes: int) -> None:
        """Process a message of this length that the station has sent."""

    @property
    def interval_s(self) -> float:
        """Minimum time between two messages."""


def congestion_control(v2x: V2x) -> CongestionControl | None:
    """The congestion control of a station that is switched on; None where the scenario has none."""
    if v2x.cam.dcc == "adaptive":
        return AdaptiveDcc(Ofdm(v2x.radio))
    return ReactiveDcc() if v2x.cam.dcc == "reactive" else None
