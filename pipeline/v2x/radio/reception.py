"""Which stations receive which transmitted messages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.draws import Draws
from advpipe.pipeline.v2x.radio.error_rate import error_free_snr_db, is_lost
from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.path_loss import SPEED_OF_LIGHT_MPS
from advpipe.pipeline.v2x.radio.stations import (
    RECEIVED,
    Bool,
    Int64,
    Outcome,
    ReceptionOutcomes,
    Stations,
    UInt8,
    UInt64,
)
from advpipe.pipeline.v2x.section import Radio

_OWN, _SENDING, _WEAK, _BUSY, _NOISE, _INTERFERENCE = (
    each.value for each in Outcome if each is not Outcome.RECEIVED
)
"""As plain numbers, see `RECEIVED`."""

BLOCK_CELLS = 1 << 17
"""Pairs of messages times stations that are looked at together: a MB, also where a thousand stations send."""


class Receiver:
    """Decides the outcome of each message at each station.

    Every overlapping message interferes with its full power for the full length of the other,
    also for a partial overlap (like the minimum SINR in Veins and INET; several that do not overlap
    with each other still add up). A receiver locks on to the first message above its sensitivity; a later one
    needs to exceed it by the capture threshold.
    """

    def __init__(self, radio: Radio, draws: Draws) -> None:
        self._radio = radio
        self._draws = draws
        self._channel_bitrate_mbps = radio.bitrate_mbps * 10 / radio.bandwidth_mhz
        self._flawless_db = max(error_free_snr_db(self._channel_bitrate_mbps), radio.snir_threshold_db)

    def outcomes(
        self, final: Sequence[RadioFrame], on_air: Sequence[RadioFrame], stations: Stations, dropped: Int64
    ) -> ReceptionOutcomes:
        """The outcomes of the messages `final`; `on_air` are these and all others that overlap with them."""
        radio, count = self._radio, len(stations.ids)
        message, sender_id, senders, request_ns, start_ns, end_ns, key, bits = _columns(
            final, "message", "sender_id", "sender", "request_ns", "start_ns", "end_ns", "key", "bits"
        )
        power_dbm = _rows([frame.power_dbm for frame in final], count)
        distance_m = _rows([frame.distance_m for frame in final], count)
        sinr_db = power_dbm - radio.noise_dbm
        is_audible = power_dbm >= radio.sensitivity_dbm
        outcome: UInt8 = ~is_audible * np.uint8(_WEAK)  # the others are RECEIVED, which is 0
        overlaps = _overlaps(message, start_ns, end_ns, on_air)
        disturbed, is_locked = self._interfere(sinr_db, power_dbm, overlaps)
        keys = key.view(np.uint64)
        place, row, column = _places(is_audible & (sinr_db < self._flawless_db))
        ids = stations.ids.view(np.uint64)
        luck = self._draws.of_some_pairs("errors", keys, ids, row, column)
        (failed,) = self._fails(luck, sinr_db.take(place), bits.take(row)).nonzero()
        place, row, luck = place.take(failed), row.take(failed), luck.take(failed)
        outcome.put(place, _NOISE)
        among = disturbed.take(row)
        place, row, luck = place[among], row[among], luck[among]
        if len(place):
            fails = self._fails(luck, power_dbm.take(place) - radio.noise_dbm, bits.take(row))
            outcome.put(place[~fails], _INTERFERENCE)
        outcome[is_locked & is_audible] = _BUSY
        sends = overlaps.other_sender >= 0
        outcome[overlaps.one[sends], overlaps.other_sender[sends]] = _SENDING
        present = senders >= 0
        outcome[np.flatnonzero(present), senders[present]] = _OWN
        return ReceptionOutcomes(
            messages=message,
            senders=sender_id,
            request_ns=request_ns,
            start_ns=start_ns,
            end_ns=end_ns,
            receivers=stations.ids,
            outcome=outcome,
            power_dbm=power_dbm,
            sinr_db=sinr_db,
            distance_m=distance_m,
            delay_ns=self._delay_ns(distance_m, keys, ids, outcome == RECEIVED),
            dropped=dropped,
        )

    def _interfere(self, ratio_db: Float64, power_dbm: Float64, overlaps: _Overlaps) -> tuple[Bool, Bool]:
        """Lower the signal-to-noise ratios (M, S) by the interference.

        Returns whether (M,) there is any, and the stations (M, S) that are locked on to an earlier message.
        """
        radio, one = self._radio, overlaps.one
        disturbed, is_locked = np.zeros(len(ratio_db), np.bool_), np.zeros(ratio_db.shape, np.bool_)
        if not radio.interference or not len(one):
            return disturbed, is_locked
        interference_mw = dict.fromkeys(one.tolist(), 0.0)
        for pairs, other_dbm in overlaps.blocks():
            for message, power_mw in zip(one[pairs].tolist(), 10 ** (other_dbm / 10), strict=True):
                interference_mw[message] = interference_mw[message] + power_mw
            is_earlier = overlaps.is_earlier[pairs]
            later, earlier_dbm = one[pairs][is_earlier], other_dbm[is_earlier]
            locks = power_dbm[later] < earlier_dbm + radio.capture_threshold_db
            locks &= earlier_dbm >= radio.sensitivity_dbm
            pair, column = locks.nonzero()
            is_locked[later[pair], column] = True
        disturbed[one] = True
        noise_mw = 10 ** (radio.noise_dbm / 10)
        ratio_db[disturbed] -= 10 * np.log10(1 + np.array([*interference_mw.values()]) / noise_mw)
        return disturbed, is_locked

    def _fails(self, luck: Float64, ratio_db: Float64, bits: Int64) -> Bool:
        """Whether messages have bit errors; all do below the configured threshold."""
        lost = is_lost(luck, ratio_db, bits, self._channel_bitrate_mbps)
        return lost | (ratio_db < self._radio.snir_threshold_db)

    def _delay_ns(self, distance_m: Float64, keys: UInt64, ids: UInt64, is_received: Bool) -> Int64:
        """Propagation and processing of each received message (M, S); else 0."""
        low_s, high_s = self._radio.processing_delay_min_s, self._radio.processing_delay_max_s
        delay_s = distance_m / SPEED_OF_LIGHT_MPS
        delay_s += low_s
        if high_s > low_s:
            place, row, column = _places(is_received)
            luck = self._draws.of_some_pairs("processing", keys, ids, row, column)
            delay_s.ravel()[place] += (high_s - low_s) * luck
        delay_s *= 1e9
        np.rint(delay_s, out=delay_s)
        with np.errstate(invalid="ignore"):  # a station that has come since is infinitely far
            delay_ns = delay_s.astype(np.int64)
        delay_ns *= is_received
        return delay_ns


class _Overlaps(NamedTuple):
    """The P pairs of messages on the air at the same time, by the first.

    one: (P,), indices of the messages whose outcomes are decided. other: (P,), indices of the other ones in
    `on_air`; other_sender: (P,), columns of their senders; is_earlier: (P,), whether they started first.
    """

    one: Int64
    other: Int64
    other_sender: Int64
    is_earlier: Bool
    on_air: Sequence[RadioFrame]

    def blocks(self) -> Iterator[tuple[slice, Float64]]:
        """Some (B) of the pairs after the other, with the powers (B, S) of the other messages in dBm.

        All at once would take gigabytes where thousands of stations hear each other.
        """
        others = self.other.tolist()
        size = max(1, BLOCK_CELLS // max(1, len(self.on_air[0].power_dbm))) if others else 1
        for first in range(0, len(others), size):
            some = slice(first, first + size)
            yield some, np.array([self.on_air[index].power_dbm for index in others[some]])


def _overlaps(message: Int64, start_ns: Int64, end_ns: Int64, on_air: Sequence[RadioFrame]) -> _Overlaps:
    number, other_start_ns, other_end_ns, sender = _columns(on_air, "message", "start_ns", "end_ns", "sender")
    _, row, column = _places((start_ns[:, None] < other_end_ns) & (other_start_ns < end_ns[:, None]))
    is_other = number[column] != message[row]
    one, other = row[is_other], column[is_other]
    return _Overlaps(one, other, sender[other], other_start_ns[other] < start_ns[one], on_air)


def _places(mask: Bool) -> tuple[Int64, Int64, Int64]:
    """Where a mask (M, S) is set: in its flat form, by row and by column; `np.nonzero` takes far longer."""
    stations = max(mask.shape[1], 1)
    (place,) = mask.ravel().nonzero()
    row = place // stations
    return place, row, place - row * stations


def _rows(rows: Sequence[Float64], count: int) -> Float64:
    return np.array(rows).reshape(len(rows), count)


def _columns(frames: Sequence[RadioFrame], *names: str) -> list[Int64]:
    values = chain.from_iterable(map(attrgetter(*names), frames))
    return list(np.fromiter(values, np.int64).reshape(len(frames), len(names)).T.copy())
