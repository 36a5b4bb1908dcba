"""Listen before talk: when waiting messages are transmitted (CSMA/CA of IEEE 802.11).

A message is sent immediately if its station has sensed no signal for an AIFS. Otherwise it waits for the
channel to be free for an AIFS, and then counts down random slots; the countdown stops while the channel is
busy.
Simplified: propagation takes no time here, and there is one threshold for signals and energy, one queue for
all messages, and no backoff after a message sent on a free channel. As in every broadcast, nothing is
acknowledged or retransmitted, and the contention window stays the same.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from operator import attrgetter

import numpy as np

from advpipe.pipeline.v2x.radio.frame import RadioFrame
from advpipe.pipeline.v2x.radio.ofdm import Ofdm
from advpipe.pipeline.v2x.radio.stations import Bool, Int64

LONG_AGO_NS = -(10**18)
CCA_TIME_NS = 8_000
"""Stations that start within this time of each other do not sense each other (clear channel assessment)."""


_start_ns = attrgetter("start_ns")


class _Contender:
    """The first message in a station's queue, and when it will start unless another station starts
    earlier."""

    __slots__ = ("countdown_ns", "frame", "start_ns")

    def __init__(self, frame: RadioFrame) -> None:
        self.frame, self.start_ns, self.countdown_ns = frame, 0, 0

    def contend(self, now_ns: int, free_ns: int, ofdm: Ofdm) -> None:
        """Wait for the channel, which is free from `free_ns` on according to the transmissions so far."""
        self.countdown_ns = free_ns + ofdm.aifs_ns
        waiting_ns = self.countdown_ns + self.frame.slots * ofdm.slot_ns
        self.start_ns = now_ns if now_ns >= self.countdown_ns else waiting_ns

    def freeze(self, now_ns: int, free_ns: int, ofdm: Ofdm) -> None:
        """Stop the countdown, as another station has started."""
        self.frame.slots -= max(0, (now_ns - self.countdown_ns) // ofdm.slot_ns)
        self.contend(now_ns, free_ns, ofdm)


class Access:
    """The transmit queues of all stations, as an event simulation.

    _taken: until when transmissions take the channel, and at which stations (S,); those that ended an AIFS
    ago or earlier are forgotten, as they hold back nobody.
    """

    def __init__(self, ofdm: Ofdm, queue_delay_max_ns: int) -> None:
        self._ofdm = ofdm
        self._queue_delay_max_ns = queue_delay_max_ns
        self._contenders: dict[int, _Contender] = {}
        self._queues: dict[int, deque[RadioFrame]] = {}
        self._taken: list[tuple[int, Bool]] = []

    def waiting(self) -> list[RadioFrame]:
        """All messages that are not on the air yet."""
        queued = [frame for queue in self._queues.values() for frame in queue]
        return [*(contender.frame for contender in self._contenders.values()), *queued]

    def rearrange(self, columns: Int64) -> list[RadioFrame]:
        """Follow a change of the stations (see `RadioFrame.rearrange`); return the messages of stations that
        left.

        Call it after the frames have been rearranged.
        """
        is_new = columns < 0
        self._taken = [(end_ns, ~is_new & np.append(taken, False)[columns]) for end_ns, taken in self._taken]
        gone = [sender for sender, head in self._contenders.items() if head.frame.sender < 0]
        dropped = []
        for sender in gone:
            dropped += [self._contenders.pop(sender).frame, *self._queues.pop(sender, ())]
        return dropped

    def run(self, requests: list[RadioFrame], until_ns: int) -> tuple[list[RadioFrame], list[RadioFrame]]:
        """Advance to `until_ns`; return the messages sent before it, by start, and those dropped.

        requests: messages handed over before `until_ns`, in order of their request times.
        """
        sent: list[RadioFrame] = []
        dropped: list[RadioFrame] = []
        arriving = deque(requests)
        while True:
            head = min(self._contenders.values(), key=_start_ns) if self._contenders else None
            if arriving and (head is None or arriving[0].request_ns <= head.start_ns):
                frame = arriving.popleft()
                if head is None and self._is_free(frame, arriving):
                    self._start(frame, frame.request_ns, sent)
                else:
                    self._arrive(frame)
            elif head is not None and head.start_ns < until_ns:
                self._leave(head, sent, dropped)
            else:
                return sent, dropped

    def _is_free(self, frame: RadioFrame, arriving: Sequence[RadioFrame]) -> bool:
        """Whether a message that has no contender starts at once, and alone."""
        if arriving and arriving[0].request_ns == frame.request_ns:
            return False
        return frame.request_ns >= self._free_ns(frame) + self._ofdm.aifs_ns

    def _arrive(self, frame: RadioFrame) -> None:
        if frame.sender_id in self._contenders:
            self._queues.setdefault(frame.sender_id, deque()).append(frame)
        else:
            self._enter(frame, frame.request_ns)

    def _enter(self, frame: RadioFrame, now_ns: int) -> None:
        contender = self._contenders[frame.sender_id] = _Contender(frame)
        contender.contend(now_ns, self._free_ns(frame), self._ofdm)

    def _free_ns(self, frame: RadioFrame) -> int:
        """When the channel is free at the sender of a frame, or was a long time ago."""
        free_ns, sender = LONG_AGO_NS, frame.sender
        for end_ns, taken in self._taken:
            if end_ns > free_ns and taken[sender]:
                free_ns = end_ns
        return free_ns

    def _leave(self, head: _Contender, sent: list[RadioFrame], dropped: list[RadioFrame]) -> None:
        frame, now_ns = head.frame, head.start_ns
        del self._contenders[frame.sender_id]
        if now_ns - frame.request_ns > self._queue_delay_max_ns:
            dropped.append(frame)
        else:
            self._start(frame, now_ns, sent)
            self._silence(frame.hearing, now_ns)
        if queue := self._queues.get(frame.sender_id):
            self._enter(queue.popleft(), now_ns)
            if not queue:
                del self._queues[frame.sender_id]

    def _start(self, frame: RadioFrame, now_ns: int, sent: list[RadioFrame]) -> None:
        frame.send(now_ns)
        sent.append(frame)
        since_ns = now_ns - self._ofdm.aifs_ns
        self._taken = [one for one in self._taken if one[0] > since_ns]
        self._taken.append((frame.end_ns, frame.hearing))

    def _silence(self, hearing: Bool, now_ns: int) -> None:
        for other in self._contenders.values():
            if hearing[other.frame.sender] and other.start_ns > now_ns + CCA_TIME_NS:
                other.freeze(now_ns, self._free_ns(other.frame), self._ofdm)
