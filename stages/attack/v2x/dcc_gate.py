"""Congestion control (DCC) of attackers that respect it while they flood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.dcc import SAMPLE_INTERVAL_S, ReactiveDcc
from advpipe.pipeline.v2x.radio.ofdm import Ofdm
from advpipe.pipeline.v2x.radio.path_loss import PATH_LOSS
from advpipe.pipeline.v2x.section import V2x


class DccGate:
    """The minimum time between two messages of each attacker's radio, by reactive congestion control.

    The radio model runs only after all editors, so the channel load is an estimate: the air time of all
    messages whose mean received power exceeds the carrier sense threshold; overlaps count twice.
    """

    def __init__(self, v2x: V2x, attackers: Sequence[int]) -> None:
        self._radio, self._ofdm = v2x.radio, Ofdm(v2x.radio)
        self._controls = {attacker: ReactiveDcc() for attacker in attackers}
        self._busy_ns = dict.fromkeys(attackers, 0.0)
        self._since_ns: int | None = None

    def interval_s(self, attacker: int) -> float:
        """The minimum interval of all messages of its radio, whatever station ids they claim."""
        return self._controls[attacker].interval_s

    def observe(self, step: V2xStep, sent: Sequence[Sent]) -> None:
        """Update the load with the messages of a step, after the step; radios stand still within it."""
        if step.end_ns is None:
            return
        self._since_ns = step.begin_ns if self._since_ns is None else self._since_ns
        places_m = {radio.station_id: radio.map_SE3_base[:3, 3] for radio in step.radios}
        transmissions = [message for message in sent if message.station_id in places_m]
        if transmissions:
            senders_m = np.array([places_m[message.station_id] for message in transmissions])
            power_dbm = np.array([message.power_dbm for message in transmissions])
            air_ns = self._ofdm.air_time_ns([len(message.payload) for message in transmissions])
            for attacker in self._controls:
                if attacker in places_m:
                    distance_m = np.linalg.norm(senders_m - places_m[attacker], axis=1)
                    received_dbm = power_dbm - PATH_LOSS[self._radio.path_loss](distance_m, self._radio)
                    is_sensed = received_dbm >= self._radio.carrier_sense_dbm
                    self._busy_ns[attacker] += float(air_ns[is_sensed].sum())
        elapsed_ns = step.end_ns - self._since_ns
        if elapsed_ns >= SAMPLE_INTERVAL_S * 1e9:
            for attacker, control in self._controls.items():
                control.update(min(self._busy_ns[attacker] / elapsed_ns, 1.0))
                self._busy_ns[attacker] = 0.0
            self._since_ns = step.end_ns
