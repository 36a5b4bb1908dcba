"""Whether what vehicles received is what was sent: the truth about receptions against packets and senders."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import blake2b
from typing import Any, NamedTuple

from advpipe.pipeline.labels.messages import FILE
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import V2X_SENT, VehicleTopics
from advpipe.pipeline.v2x.codec.btp import btp_packet
from advpipe.stages.verify.checks.base import MessageCheck, MessageView
from advpipe.stages.verify.checks.rates import RECOVERED_KEY
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import Bag

KEPT_S = 120
"""A message waits for at most a minute at its sender, and less at its receiver."""

_OF_ANY = VehicleTopics("any")
_PACKETS, _INFOS, _TRUTHS = _KINDS = tuple(
    topic.name.removeprefix("/any/")
    for topic in (_OF_ANY.received_raw, _OF_ANY.reception_info, _OF_ANY.true_receptions)
)
"""Topics of a vehicle, without its name."""


class _Sent(NamedTuple):
    station_id: int
    request_ns: int
    digest: bytes


class _Arrival:
    """What one vehicle received at one instant, by kind of topic."""

    def __init__(self, stamp_ns: int) -> None:
        self.stamp_ns = stamp_ns
        self.messages: dict[str, list[Any]] = {kind: [] for kind in _KINDS}


class ReceptionsCheck(MessageCheck):
    """In advpipe's bags, of packets as long as they are awaited; attacks that left them alone copy them.

    Power and SINR are believed: the radio does not run again.
    """

    def __init__(self, bag: Bag) -> None:
        super().__init__(bag)
        self._sent: dict[int, _Sent] = {}
        self._arrivals: dict[str, _Arrival] = {}
        kinds = {_received(name)[1] for name in bag.reader.topics}
        is_copy = bag.is_attack and not (bag.path / FILE).is_file()
        self._is_expected = bag.is_own and not is_copy and _PACKETS in kinds
        self._has_truth = _TRUTHS in kinds

    def see(self, seen: MessageView) -> Iterator[Result]:
        if not self._is_expected or not self._has_truth:
            return
        name = seen.raw.topic.name
        if name == V2X_SENT.name:
            self._remember(seen)
            return
        vehicle, kind = _received(name)
        if not kind or seen.message is None:
            return
        stamp_ns, known = build.stamp_ns(seen.message), self._arrivals.get(vehicle)
        if known is None or known.stamp_ns != stamp_ns:
            if known is not None:
                yield from self._compare(vehicle, known)
            known = self._arrivals[vehicle] = _Arrival(stamp_ns)
        known.messages[kind].append(seen.message)

    def check(self) -> Iterator[Result]:
        for vehicle, arrival in self._arrivals.items():
            yield from self._compare(vehicle, arrival, is_last=True)
        if self._is_expected and not self._has_truth:
            yield Unchecked(
                self.bag.place, f"no {_TRUTHS}: the bag does not record which sent messages were received"
            )

    def _remember(self, seen: MessageView) -> None:
        """Of what was sent; forgets what nobody waits for any more."""
        if (message := seen.message) is None:
            return
        number, request_ns = int(message.number), build.stamp_ns(message)
        self._sent.pop(number, None)
        self._sent[number] = _Sent(int(message.station_id), request_ns, _digest(bytes(message.payload)))
        while (oldest := next(iter(self._sent))) != number and (
            self._sent[oldest].request_ns < request_ns - KEPT_S * build.NS_PER_S
        ):
            del self._sent[oldest]

    def _compare(self, vehicle: str, arrival: _Arrival, is_last: bool = False) -> Iterator[Result]:
        packets, infos, truths = (arrival.messages[kind] for kind in _KINDS)
        is_cut = is_last and RECOVERED_KEY in self.bag.provenance
        for kind, beside in ((_INFOS, infos), (_TRUTHS, truths)):
            if len(beside) != len(packets) and not is_cut:
                yield Fault(
                    self._where(vehicle, kind),
                    f"holds {len(beside)} messages for the {len(packets)} packets received at "
                    f"{arrival.stamp_ns} ns",
                )
        for packet, truth in zip(packets, truths, strict=False):
            if problem := self._wrong(packet, truth, arrival.stamp_ns):
                yield Fault(
                    self._where(vehicle, _TRUTHS), f"at {arrival.stamp_ns} ns names message {problem}"
                )

    def _wrong(self, packet: Any, truth: Any, arrival_ns: int) -> str:
        number = int(truth.number)
        sent = self._sent.get(number)
        if sent is None:
            return f"{number}, which no station sent in the {KEPT_S} s before"
        if sent.station_id != truth.station_id:
            return f"{number} of station {truth.station_id}, which station {sent.station_id} sent"
        if sent.request_ns > arrival_ns:
            return f"{number}, which was sent later, at {sent.request_ns} ns"
        header = len(btp_packet(b""))
        if _digest(bytes(packet.data)[header:]) != sent.digest:
            return f"{number}, whose bytes differ from the received ones"
        return ""

    def _where(self, vehicle: str, kind: str) -> str:
        return f"{self.bag.place} /{vehicle}/{kind}"


def _received(topic: str) -> tuple[str, str]:
    """The vehicle and the kind of one of its topics; no kind for other topics."""
    vehicle, _, kind = topic.removeprefix("/").partition("/")
    return vehicle, kind if kind in _KINDS else ""


def _digest(payload: bytes) -> bytes:
    return blake2b(payload, digest_size=16).digest()
