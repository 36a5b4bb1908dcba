"""Congestion control of the benign stations on a channel that an attack has loaded."""

from __future__ import annotations

from collections.abc import Sequence

from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.congestion_control import CongestionControl, congestion_control
from advpipe.pipeline.v2x.message_type import is_cam
from advpipe.pipeline.v2x.radio.load import ChannelLoad
from advpipe.pipeline.v2x.section import V2x


class Congestion:
    """Holds back messages that a station's congestion control would not have allowed.

    A recorded drive does not contain what a station would have sent later instead: a message too soon after
    the station's last one is lost, and the next recorded one follows. Under the channel load of the
    recording, nothing is held back.

    held_back: how many messages so far.
    """

    def __init__(self, v2x: V2x, attackers: frozenset[int]) -> None:
        self._v2x, rules = v2x, v2x.cam
        self._least_ns, self._most_ns = round(rules.min_interval_s * 1e9), round(rules.max_interval_s * 1e9)
        self._attackers = attackers
        self._controls: dict[int, CongestionControl] = {}
        self._last_ns: dict[int, int] = {}
        self.held_back = 0

    def allowed(self, step: V2xStep, sent: Sequence[Sent]) -> list[Sent]:
        """The messages that are sent in this step."""
        present = {radio.station_id for radio in step.radios}
        self._controls = {
            number: control
            for number in sorted(present)  # a station that returns was switched on again
            if (control := self._controls.get(number) or congestion_control(self._v2x)) is not None
        }
        self._last_ns = {number: at_ns for number, at_ns in self._last_ns.items() if number in present}
        kept = [
            message
            for message in sent
            if message.station_id in self._attackers or not is_cam(message.payload) or self._passes(message)
        ]
        self.held_back += len(sent) - len(kept)
        return kept

    def observe(self, loads: Sequence[ChannelLoad]) -> None:
        """Update with the channel loads that the stations measured in the step."""
        for load in loads:
            for number, busy_ratio in zip(load.stations.tolist(), load.busy_ratio.tolist(), strict=True):
                if number in self._controls:
                    self._controls[number].update(busy_ratio)

    def _passes(self, sent: Sent) -> bool:
        control = self._controls[sent.station_id]
        interval_ns = round(control.interval_s * 1e9)
        interval_ns = min(max(interval_ns, self._least_ns), self._most_ns)
        last_ns = self._last_ns.get(sent.station_id)
        if last_ns is not None and sent.request_ns - last_ns < interval_ns:
            return False
        control.sent(len(sent.payload))
        self._last_ns[sent.station_id] = sent.request_ns
        return True
