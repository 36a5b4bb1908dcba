"""Air time of messages, and the time units of channel access."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.v2x.section import CHANNEL_BITRATES_MBPS, Radio

Int64 = npt.NDArray[np.int64]

BITS_PER_SYMBOL = dict(zip(CHANNEL_BITRATES_MBPS, (24, 36, 48, 72, 96, 144, 192, 216), strict=True))
"""Data bits of an OFDM symbol by the bitrate in a channel of 10 MHz (IEEE 802.11-2016, table 17-4)."""

SERVICE_AND_TAIL_BITS = 16 + 6
SLOT_AND_SIFS_NS = {5: (21_000, 64_000), 10: (13_000, 32_000), 20: (9_000, 16_000)}
"""By the channel's width in MHz (IEEE 802.11-2016, table 17-21)."""

AIFSN, CONTENTION_SLOTS = 6, 15
"""Of access category AC_BE outside a BSS, which profile DP2 and so CAMs use (EN 302 663, TS 102 636-4-2)."""


class Ofdm:
    """Times in nanoseconds of an OFDM radio with these settings."""

    def __init__(self, radio: Radio) -> None:
        self._bits_per_symbol = BITS_PER_SYMBOL[radio.bitrate_mbps * 10 / radio.bandwidth_mhz]
        self._symbol_ns = 80_000 // radio.bandwidth_mhz
        self._overhead_bytes = radio.overhead_bytes
        self.slot_ns, sifs_ns = SLOT_AND_SIFS_NS[radio.bandwidth_mhz]
        self.aifs_ns = sifs_ns + AIFSN * self.slot_ns

    def frame_bits(self, cam_bytes: npt.ArrayLike) -> Int64:
        """Bits of the MAC frames around CAMs of these lengths."""
        return 8 * (np.asarray(cam_bytes, np.int64) + self._overhead_bytes)

    def air_time_ns(self, cam_bytes: npt.ArrayLike) -> Int64:
        """Air time: preamble (four symbols), SIGNAL field (one) and data, in whole symbols."""
        symbols = -(-(self.frame_bits(cam_bytes) + SERVICE_AND_TAIL_BITS) // self._bits_per_symbol)
        return (5 + symbols) * self._symbol_ns
