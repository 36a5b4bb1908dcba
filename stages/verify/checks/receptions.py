"""Whether received packets match the sent messages that the ground truth of receptions names."""

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
from advpipe.stages.verify.subject import BagUnderTest

KEPT_S = 120
"""Sent messages are kept this long; a message waits for at most a minute at its sender, less at its
receiver."""

_ANY = VehicleTopics("any")
_PACKETS, _INFOS, _TRUTHS = _SUFFIXES = tuple(
    topic.name.removeprefix("/any/")
    for topic in (_ANY.received_raw, _ANY.reception_info, _ANY.true_receptions)
)
"""Topics of a vehicle, without its name."""


class _Sent(NamedTuple):
    station_id: int
    request_ns: int
    digest: bytes


class _Arrival:
    """The messages that one vehicle received at one instant, by topic."""

    def __init__(self, stamp_ns: int) -> None:
        self.stamp_ns = stamp_ns
        self.messages: dict[str, list[Any]] = {suffix: [] for suffix in _SUFFIXES}


class ReceptionsCheck(MessageCheck):
    """Checks advpipe's bags, except attacks that did not touch messages, since `Copies` compares those.

    Power and SINR are not checked, since the radio model is not run again.
    """

    def __init__(self, bag: BagUnderTest) -> None:
        super().__init__(bag)
        self._sent: dict[int, _Sent] = {}
        self._arrivals: dict[str, _Arrival] = {}
        suffixes = {_received(name)[1] for name in bag.reader.topics}
        is_copy = bag.is_attack and not (bag.path / FILE).is_file()
        self._is_expected = bag.is_own and not is_copy and _PACKETS in suffixes
        self._has_truth = _TRUTHS in suffixes

    def see(self, view: MessageView) -> Iterator[Result]:
        if not self._is_expected or not self._has_truth:
            return
        name = view.raw.topic.name
        if name == V2X_SENT.name:
            self._remember(view)
            return
        vehicle, suffix = _received(name)
        if not suffix or view.message is None:
            return
        stamp_ns, latest = build.stamp_ns(view.message), self._arrivals.get(vehicle)
        if latest is None or latest.stamp_ns != stamp_ns:
            if latest is not None:
                yield from self._compare(vehicle, latest)
            latest = self._arrivals[vehicle] = _Arrival(stamp_ns)
        latest.messages[suffix].append(view.message)

    def check(self) -> Iterator[Result]:
        for vehicle, arrival in self._arrivals.items():
            yield from self._compare(vehicle, arrival, is_last=True)
        if self._is_expected and not self._has_truth:
            yield Unchecked(
                self.bag.place, f"no {_TRUTHS}: the bag does not record which sent messages were received"
            )

    def _remember(self, view: MessageView) -> None:
        """Store a sent message; forget messages older than `KEPT_S`."""
        if (message := view.message) is None:
            return
        number, request_ns = int(message.number), build.stamp_ns(message)
        self._sent.pop(number, None)
        self._sent[number] = _Sent(int(message.station_id), request_ns, _digest(bytes(message.payload)))
        while (oldest := next(iter(self._sent))) != number and (
            self._sent[oldest].request_ns < request_ns - KEPT_S * build.NS_PER_S
        ):
            del self._sent[oldest]

    def _compare(self, vehicle: str, arrival: _Arrival, is_last: bool = False) -> Iterator[Result]:
        packets, infos, truths = (arrival.messages[suffix] for suffix in _SUFFIXES)
        is_truncated = is_last and RECOVERED_KEY in self.bag.provenance
        for suffix, beside in ((_INFOS, infos), (_TRUTHS, truths)):
            if len(beside) != len(packets) and not is_truncated:
                yield Fault(
                    self._where(vehicle, suffix),
                    f"holds {len(beside)} messages for the {len(packets)} packets received at "
                    f"{arrival.stamp_ns} ns",
                )
        for packet, truth in zip(packets, truths, strict=False):
            if problem := self._mismatch(packet, truth, arrival.stamp_ns):
                yield Fault(
                    self._where(vehicle, _TRUTHS), f"at {arrival.stamp_ns} ns names message {problem}"
                )

    def _mismatch(self, packet: Any, truth: Any, arrival_ns: int) -> str:
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

    def _where(self, vehicle: str, suffix: str) -> str:
        return f"{self.bag.place} /{vehicle}/{suffix}"


def _received(topic: str) -> tuple[str, str]:
    """The vehicle and the topic without its name; an empty topic for any that is not about receptions."""
    vehicle, _, suffix = topic.removeprefix("/").partition("/")
    return vehicle, suffix if suffix in _SUFFIXES else ""


def _digest(payload: bytes) -> bytes:
    return blake2b(payload, digest_size=16).digest()
