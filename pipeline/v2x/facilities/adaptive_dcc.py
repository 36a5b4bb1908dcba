"""Adaptive decentralised congestion control (ETSI TS 102 687 v1.2.1, 5.4), known as LIMERIC.

Each station adapts the share of time that it may send to the channel load that all measure, so that the load
approaches a target and the stations share it equally (Bansal, Kenney and Rohrs, "LIMERIC: a linear adaptive
message rate algorithm for DSRC congestion control", IEEE TVT 62(9), 2013).
"""

from __future__ import annotations

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.v2x.radio.ofdm import Ofdm

ALPHA, BETA = 0.016, 0.0012
TARGET_LOAD = 0.68
"""CBR_target."""
LARGEST_SHARE, SMALLEST_SHARE = 0.03, 0.0006
"""delta_max and delta_min: of the time."""
LARGEST_RISE, LARGEST_FALL = 0.0005, -0.00025
"""G+_max and G-_max: of the share in one update, before the decay by `ALPHA`."""
SHORTEST_S, LONGEST_S = 0.025, 1.0
"""Limits of the time between two messages (TS 102 687, annex B.2)."""


class AdaptiveDcc:
    """The share of time of one station, updated at every second measurement of the channel load (0.2 s).

    share: of the time that it may send, delta in the standard; at first the largest, as no load is known yet.
    load: the smoothed channel load, CBR_ITS-S in the standard.
    """

    def __init__(self, ofdm: Ofdm) -> None:
        self._ofdm = ofdm
        self._before: float | None = None
        self._air_time_s = 0.0
        self.load, self.share = 0.0, LARGEST_SHARE

    def update(self, channel_load: float) -> None:
        """Process the share of the last 0.1 s in which the channel was busy.

        Raises AdvpipeError outside of [0, 1].
        """
        if not 0 <= channel_load <= 1:
            raise AdvpipeError(f"channel load {channel_load} is not a share of time in [0, 1]")
        if self._before is None:
            self._before = channel_load
            return
        self.load = 0.5 * self.load + 0.25 * (channel_load + self._before)
        self._before = None
        offset = min(max(BETA * (TARGET_LOAD - self.load), LARGEST_FALL), LARGEST_RISE)
        self.share = min(max((1 - ALPHA) * self.share + offset, SMALLEST_SHARE), LARGEST_SHARE)

    def sent(self, cam_bytes: int) -> None:
        """Process a message of the station; its air time decides when the next one may follow."""
        self._air_time_s = int(self._ofdm.air_time_ns(cam_bytes)) / 1e9

    @property
    def interval_s(self) -> float:
        """Minimum time between two messages."""
        return min(max(self._air_time_s / self.share, SHORTEST_S), LONGEST_S)
