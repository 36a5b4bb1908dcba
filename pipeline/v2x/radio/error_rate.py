"""The probability that a message arrives without bit errors: the NIST model of OFDM's error rate.

Miller, "Validation of 802.11a/UWB coexistence simulation", NIST 2003; Pei and Henderson, "Validation of OFDM
error rate model in ns-3", 2010: the union bound over the convolutional code's distance spectrum.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64

Bool = npt.NDArray[np.bool_]
Int64 = npt.NDArray[np.int64]


class Code(NamedTuple):
    """A convolutional code: `bits` in for each step, and information errors by distance."""

    bits: int
    distances: tuple[int, ...]
    weights: tuple[int, ...]


HALF = Code(
    1, tuple(range(10, 28, 2)), (36, 211, 1404, 11633, 77433, 502690, 3322763, 21292910, 134365911)
)  # fmt: skip
TWO_THIRDS = Code(
    2, tuple(range(6, 16)), (3, 70, 285, 1276, 6160, 27128, 117019, 498835, 2103480, 8781268)
)  # fmt: skip
THREE_QUARTERS = Code(
    3,
    tuple(range(5, 15)),
    (42, 201, 1492, 10469, 62935, 379546, 2252394, 13064540, 75080308, 427474864),
)
"""Generators 133 and 171 (octal), punctured to 2/3 and 3/4; the spectra follow from the trellis.

Their last terms in ns-3's tables (after Haccoun and Begin, 1989) are up to 0.13 % larger.
"""


def _bpsk(snr: Float64) -> Float64:
    return 0.5 * _erfc(np.sqrt(snr))


def _qpsk(snr: Float64) -> Float64:
    return 0.5 * _erfc(np.sqrt(snr / 2))


def _qam16(snr: Float64) -> Float64:
    return 3 / 8 * _erfc(np.sqrt(snr / 10))


def _qam64(snr: Float64) -> Float64:
    return 7 / 24 * _erfc(np.sqrt(snr / 42))


def _erfc(value: Float64) -> Float64:
    from scipy.special import erfc

    return np.asarray(erfc(value))


MODULATIONS: dict[float, tuple[Callable[[Float64], Float64], Code]] = {
    3.0: (_bpsk, HALF),
    4.5: (_bpsk, THREE_QUARTERS),
    6.0: (_qpsk, HALF),
    9.0: (_qpsk, THREE_QUARTERS),
    12.0: (_qam16, HALF),
    18.0: (_qam16, THREE_QUARTERS),
    24.0: (_qam64, TWO_THIRDS),
    27.0: (_qam64, THREE_QUARTERS),
}
"""Raw bit error rate and code by the bitrate in a channel of 10 MHz."""


def success_rate(snr_db: Float64, bits: npt.ArrayLike, channel_bitrate_mbps: float) -> Float64:
    """The share (...) of messages of `bits` bits (...) that arrive without error at this signal-to-noise
    ratio."""
    rate: Float64 = np.exp(np.asarray(bits) * _log_rate_of_a_bit(snr_db, channel_bitrate_mbps))
    return rate


def _log_rate_of_a_bit(snr_db: Float64, channel_bitrate_mbps: float) -> Float64:
    bit_error_rate, code = MODULATIONS[channel_bitrate_mbps]
    raw = bit_error_rate(10 ** (snr_db / 10))
    bhattacharyya = np.sqrt(4 * raw * (1 - raw))
    step = code.distances[1] - code.distances[0]
    series = np.polynomial.polynomial.polyval(bhattacharyya**step, (0, *code.weights))
    event = series * bhattacharyya ** (code.distances[0] - step) / (2 * code.bits)
    rate: Float64 = np.log1p(-np.minimum(event, 1 - 1e-16))
    return rate


def is_lost(luck: Float64, snr_db: Float64, bits: Int64, channel_bitrate_mbps: float) -> Bool:
    """Whether luck (N,), drawn from (0, 1), exceeds `success_rate` (N,).

    The rates at the ends of an interval of 1 / `_PER_DB` nearly always decide, in a tenth of the time.
    """
    table = _log_rates(channel_bitrate_mbps)
    places = (snr_db - _TABLE_FROM_DB) * _PER_DB
    np.maximum(places, 0, out=places)
    interval = np.minimum(places, len(table) - 2, out=places).astype(np.int64)
    log_luck = np.log(luck)
    lost: Bool = log_luck > bits * table[1:].take(interval) + _ROUNDING
    (unclear,) = (lost ^ (log_luck > bits * table.take(interval) - _ROUNDING)).nonzero()
    if len(unclear):
        lost[unclear] = luck[unclear] > success_rate(snr_db[unclear], bits[unclear], channel_bitrate_mbps)
    return lost


_TABLE_FROM_DB, _PER_DB = -5.0, 2048
_ROUNDING = 1e-9
"""More than the rounding errors of a logarithm of a rate that luck can be near to."""


@cache
def _log_rates(channel_bitrate_mbps: float) -> Float64:
    """Logarithms of the rate of one bit, ascending; the outer intervals reach to infinity."""
    ratios_db = np.arange(_TABLE_FROM_DB, error_free_snr_db(channel_bitrate_mbps), 1 / _PER_DB)
    inner = _log_rate_of_a_bit(ratios_db, channel_bitrate_mbps)
    return np.concatenate([[-np.inf], inner[1:-1], [0.0]])


@cache
def error_free_snr_db(channel_bitrate_mbps: float) -> float:
    """A ratio above which `success_rate` is exactly 1 for any message that the radio can send."""
    ratios_db = np.arange(0.0, 60.0, 0.25)
    is_certain = success_rate(ratios_db, _MANY_BITS, channel_bitrate_mbps) == 1.0
    return float(ratios_db[~is_certain][-1] + 0.25)


_MANY_BITS = 2**20
"""Some thirty times the bits of the longest frame, 4095 bytes."""
