"""Which stations receive which transmitted messages."""

from __future__ import annotations

from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.v2x.radio.draws import Draws
from advpipe.pipeline.v2x.radio.error_rate import error_free_snr_db, success_rate
from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.path_loss import SPEED_OF_LIGHT_MPS
from advpipe.pipeline.v2x.radio.stations import (
    Bool,
    Int64,
    Outcome,
    ReceptionOutcomes,
    Stations,
    UInt8,
    UInt64,
)
from advpipe.pipeline.v2x.section import Radio


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
        start_ns, end_ns, key, bits = _columns(final, "start_ns", "end_ns", "key", "bits")
        power_dbm = _rows([frame.power_dbm for frame in final], count)
        distance_m = _rows([frame.distance_m for frame in final], count)
        interference_mw, is_busy, is_sending = self._overlaps(final, on_air, power_dbm)

        snr_db = power_dbm - radio.noise_dbm
        noise_mw = 10 ** (radio.noise_dbm / 10)
        sinr_db = snr_db.copy()
        disturbed: Bool = interference_mw.max(axis=1, initial=0.0) > 0
        sinr_db[disturbed] -= 10 * np.log10(1 + interference_mw[disturbed] / noise_mw)
        keys = key.view(np.uint64)
        is_audible = power_dbm >= radio.sensitivity_dbm
        outcome: UInt8 = np.full(power_dbm.shape, Outcome.RECEIVED, np.uint8)
        row, column = _places(is_audible & (sinr_db < self._flawless_db))
        luck = self._draws.of_pairs("errors", keys[row], stations.ids[column].astype(np.uint64))
        fails = luck > self._success(sinr_db[row, column], bits[row])
        row, column, luck = row[fails], column[fails], luck[fails]
        outcome[row, column] = Outcome.NOISE
        among = disturbed[row]
        row, column, luck = row[among], column[among], luck[among]
        if len(row):
            saved = luck <= self._success(snr_db[row, column], bits[row])
            outcome[row[saved], column[saved]] = Outcome.INTERFERENCE
        outcome[is_busy] = Outcome.BUSY
        outcome[~is_audible] = Outcome.WEAK
        outcome[is_sending] = Outcome.SENDING
        senders = np.array([frame.sender for frame in final], np.int64)
        present = senders >= 0
        outcome[np.flatnonzero(present), senders[present]] = Outcome.OWN
        message, sender_id, request_ns = _columns(final, "message", "sender_id", "request_ns")
        arrival_ns = self._arrival_ns(end_ns, distance_m, keys, stations, outcome)
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
            arrival_ns=arrival_ns,
            dropped=dropped,
        )

    def _overlaps(
        self, final: Sequence[RadioFrame], on_air: Sequence[RadioFrame], power_dbm: Float64
    ) -> tuple[Float64, Bool, Bool]:
        """Interference in mW, whether the receiver is locked on to an earlier message, and whether it sends:
        (M, S)."""
        interference_mw = np.zeros_like(power_dbm)
        is_busy, is_sending = np.zeros((2, *power_dbm.shape), np.bool_)
        start, end = _columns(final, "start_ns", "end_ns")
        other_start, other_end = _columns(on_air, "start_ns", "end_ns")
        together = (start[:, None] < other_end) & (other_start < end[:, None])
        for one, other in np.argwhere(together):
            disturber = on_air[other]
            if disturber is final[one]:
                continue
            if disturber.sender >= 0:
                is_sending[one, disturber.sender] = True
            if self._radio.interference:
                interference_mw[one] += 10 ** (disturber.power_dbm / 10)
                if other_start[other] < start[one]:
                    is_busy[one] |= (disturber.power_dbm >= self._radio.sensitivity_dbm) & (
                        power_dbm[one] < disturber.power_dbm + self._radio.capture_threshold_db
                    )
        return interference_mw, is_busy, is_sending

    def _success(self, ratio_db: Float64, bits: Int64) -> Float64:
        """The probability of error-free messages; 0 below the configured threshold."""
        chance = success_rate(ratio_db, bits, self._channel_bitrate_mbps)
        return np.where(ratio_db >= self._radio.snir_threshold_db, chance, 0.0)

    def _arrival_ns(
        self, end_ns: Int64, distance_m: Float64, keys: UInt64, stations: Stations, outcome: UInt8
    ) -> Int64:
        """Arrival of each received message (M, S) after air time, propagation and processing; else 0."""
        row, column = _places(outcome == Outcome.RECEIVED)
        low_s, high_s = self._radio.processing_delay_min_s, self._radio.processing_delay_max_s
        delay_s = distance_m[row, column] / SPEED_OF_LIGHT_MPS + low_s
        if high_s > low_s:
            ids = stations.ids[column].astype(np.uint64)
            delay_s += (high_s - low_s) * self._draws.of_pairs("processing", keys[row], ids)
        arrival_ns = np.zeros(outcome.shape, np.int64)
        arrival_ns[row, column] = end_ns[row] + np.rint(delay_s * 1e9).astype(np.int64)
        return arrival_ns


def _places(mask: Bool) -> tuple[Int64, Int64]:
    """As `np.nonzero` of a mask (M, S), in a fraction of the time."""
    return np.divmod(np.flatnonzero(mask), max(mask.shape[1], 1))


def _rows(rows: Sequence[Float64], count: int) -> Float64:
    return np.array(rows).reshape(len(rows), count)


def _columns(frames: Sequence[RadioFrame], *names: str) -> list[Int64]:
    rows = np.array([*map(attrgetter(*names), frames)], np.int64).reshape(len(frames), len(names))
    return list(np.ascontiguousarray(rows.T))
