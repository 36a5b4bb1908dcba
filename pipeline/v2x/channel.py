"""The channel: from the messages that stations send to what listeners receive and store.

The simulation transmits a drive's messages as they are generated; an attack transmits those of a recorded
drive again, with some of them changed. The same messages have the same outcomes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.clock import clock_error_ns
from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.codec.message_codec import MessageTree
from advpipe.pipeline.v2x.cpm_section import CpmRules
from advpipe.pipeline.v2x.facilities.cam import CamCore
from advpipe.pipeline.v2x.facilities.cam_tree import core_of_tree
from advpipe.pipeline.v2x.facilities.cpm_tree import cpm_of_tree
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject, heard_objects
from advpipe.pipeline.v2x.facilities.ldm import (
    LdmReport,
    LdmSnapshot,
    LocalDynamicMap,
    Verdict,
    reports_of_cams,
)
from advpipe.pipeline.v2x.message_type import CAM, CPM, is_cam, message_type_of
from advpipe.pipeline.v2x.radio.buildings import Buildings
from advpipe.pipeline.v2x.radio.load import WINDOW_NS, ChannelLoad
from advpipe.pipeline.v2x.radio.medium import Medium, Step
from advpipe.pipeline.v2x.radio.stations import (
    IN_ORDER,
    Bool,
    Reception,
    ReceptionOutcomes,
    Stations,
    Transmissions,
)
from advpipe.pipeline.v2x.section import V2x
from advpipe.pipeline.v2x.security.verifier import Rejection
from advpipe.pipeline.v2x.stack import LINK_BYTES, ReceiverStack
from advpipe.pipeline.v2x.statistics import Statistics, Tally


@dataclass(frozen=True, slots=True)
class Sent:
    """A message that a station hands to its radio.

    number: unique within a drive. key: of its random draws, see `draws.message_keys`.
    station_id: the radio's true id, whatever the payload claims. payload: a message of one of the
    `MESSAGE_TYPES` in UPER, or other bytes.
    packet: GeoNetworking and security around it, as on the air; empty in a drive without.
    """

    number: int
    key: int
    station_id: int
    request_ns: int
    payload: bytes
    power_dbm: float
    packet: bytes = b""

    def with_payload(self, payload: bytes) -> Sent:
        """The same message with another content, as by `replace` in half the time."""
        return Sent(
            self.number, self.key, self.station_id, self.request_ns, payload, self.power_dbm, self.packet
        )


class Received(NamedTuple):
    """A message received by one listener; `verdict` is the result of its Local Dynamic Map.

    tree: the message's ASN.1 values (see `message_codec.py`); None for bytes that are not a valid one.
    """

    listener: str
    sent: Sent
    tree: MessageTree | None
    arrival_ns: int
    power_dbm: float
    sinr_db: float
    verdict: Verdict


class Rejected(NamedTuple):
    """A message that reached a listener, but not its facilities: a layer below rejected it."""

    listener: str
    sent: Sent
    arrival_ns: int
    rejection: Rejection


@dataclass(frozen=True)
class ChannelResult:
    """The results of one step: messages received by listeners, in order of arrival, channel loads, and the
    messages that listeners rejected."""

    received: tuple[Received, ...] = ()
    loads: tuple[ChannelLoad, ...] = ()
    rejected: tuple[Rejected, ...] = ()


class RadioMedium(Protocol):
    """`Medium`, or what takes its place. tells_why: whether it says why a message does not reach a station;
    if not, the outcome `WEAK` stands for all reasons."""

    @property
    def tells_why(self) -> bool: ...

    def advance(self, until_ns: int, stations: Stations, transmissions: Transmissions) -> Step:
        """See `Medium.advance`."""
        ...


class Channel:
    """The radio medium, and the Local Dynamic Maps of the listeners.

    listeners: names by station id of the vehicles whose receptions are returned. The receptions of all other
    stations are simulated as well, for the statistics, but not decoded. decoder: of CAMs, `decode_cam_tree`
    by default; a caller that has decoded them already may pass one that returns those values. stack: the
    receivers' layers, in a drive whose messages have packets. medium: another than ours.
    """

    def __init__(
        self,
        v2x: V2x,
        seed: int,
        geodesy: Geodesy,
        listeners: Mapping[int, str],
        buildings: Buildings | None = None,
        decoder: Callable[[bytes], MessageTree] | None = None,
        stack: ReceiverStack | None = None,
        medium: RadioMedium | None = None,
    ) -> None:
        self._decoder, self._stack = decoder, stack
        self._v2x, self._seed = v2x, seed
        self._medium: RadioMedium = Medium(v2x.radio, seed, buildings) if medium is None else medium
        self._geodesy = geodesy
        self._listeners: dict[int, str] = {}
        self._clock_errors_ns: dict[str, int] = {}
        self._maps: dict[str, LocalDynamicMap] = {}
        self._ids = np.empty(0, np.int64)
        for station_id, name in listeners.items():
            self.listen(station_id, name)
        self._on_air: dict[int, Sent] = {}
        self._others: set[int] = set()  # of those on the air, the numbers of those that are no CAMs
        self._in_transit: list[Reception] = []
        self._in_verification: list[Reception] = []
        self._tally = Tally()

    def listen(self, station_id: int, name: str) -> None:
        """Return the receptions of this station from now on; a name keeps its Local Dynamic Map."""
        self._listeners[station_id] = name
        self._ids = np.array(sorted(self._listeners), np.int64)
        if name not in self._maps:
            error_ns = clock_error_ns(self._v2x, self._seed, station_id)
            heard_kept_s = (self._v2x.cpm or CpmRules()).kept_s
            self._clock_errors_ns[name] = error_ns
            self._maps[name] = LocalDynamicMap(self._v2x.ldm, heard_kept_s, error_ns)

    def advance(self, until_ns: int, stations: Stations, sent: Sequence[Sent]) -> ChannelResult:
        """Advance to this time with all messages handed to the radios before it; see `Medium.advance`.

        Messages still in transit to a listener that has left are lost.
        """
        for message in sent:
            self._on_air[message.number] = message
        others = [message for message in sent if not is_cam(message.payload)]
        self._others.update(message.number for message in others)
        self._tally.count(message_type_of(message.payload).name for message in others)
        step = self._medium.advance(until_ns, stations, _transmissions(sent, self._v2x.radio.overhead_bytes))
        self._tally.add(step, self._are_cams(step.outcomes))
        received, rejected = self._receive(step.outcomes, until_ns, stations)
        return ChannelResult(received, step.loads, rejected)

    def finish(self, now_ns: int, stations: Stations) -> ChannelResult:
        """Advance without new messages until the outcome of every message is known.

        The channel load of this period is not counted.
        """
        received: list[Received] = []
        rejected: list[Rejected] = []
        while self._on_air:
            now_ns += WINDOW_NS
            outcomes, _ = self._medium.advance(now_ns, stations, Transmissions.none())
            self._tally.add(Step(outcomes, ()), self._are_cams(outcomes))
            more, refused = self._receive(outcomes, now_ns, stations)
            received += more
            rejected += refused
        return ChannelResult(tuple(received), rejected=tuple(rejected))

    def snapshot(self, listener: str, now_ns: int) -> LdmSnapshot:
        """The Local Dynamic Map of a listener."""
        return self._maps[listener].snapshot(now_ns)

    def statistics(self) -> Statistics:
        """The statistics so far, or since `restart_statistics`."""
        found = self._tally.statistics()
        return found if self._medium.tells_why else found.without_reasons()

    def restart_statistics(self) -> None:
        """Reset the counts; messages on the air stay there."""
        self._tally = Tally()

    def _are_cams(self, outcomes: ReceptionOutcomes) -> Bool:
        if not self._others:
            return np.ones(len(outcomes.messages), bool)
        return np.array([one not in self._others for one in outcomes.messages.tolist()], bool)

    def _receive(
        self, outcomes: ReceptionOutcomes, until_ns: int, stations: Stations
    ) -> tuple[tuple[Received, ...], tuple[Rejected, ...]]:
        """The messages that reached listeners by now; forgets the completed ones."""
        present = set(stations.ids.tolist())
        before = {reception.message for reception in (*self._in_transit, *self._in_verification)}
        arriving = [*self._in_transit, *outcomes.receptions(self._ids)]
        due, self._in_transit = _due((one for one in arriving if one.receiver in present), until_ns)
        rejected: list[Rejected] = []
        if self._stack is not None:
            checked = [*self._in_verification, *self._delivered(self._stack, due, rejected)]
            due, self._in_verification = _due((one for one in checked if one.receiver in present), until_ns)
        received = tuple(self._read(due))
        waiting = {reception.message for reception in (*self._in_transit, *self._in_verification)}
        completed = {*outcomes.messages.tolist(), *outcomes.dropped.tolist()}
        for number in completed.union(before) - waiting:
            del self._on_air[number]
        self._others -= completed
        self._tally.reject(one.rejection.value for one in rejected)
        return received, tuple(rejected)

    def _delivered(
        self, stack: ReceiverStack, receptions: Sequence[Reception], rejected: list[Rejected]
    ) -> Iterator[Reception]:
        """The receptions that reach the facilities, and when they do; the others join `rejected`."""
        for reception in receptions:
            listener, sent = self._listeners[reception.receiver], self._on_air[reception.message]
            error_ns = self._clock_errors_ns[listener]
            delivery = stack.deliver(listener, sent.packet, reception.arrival_ns + error_ns)
            rejection = delivery.rejection
            if rejection is None and delivery.payload != sent.payload:
                rejection = Rejection.MALFORMED
            if rejection is None:
                yield reception._replace(arrival_ns=delivery.done_ns - error_ns)
            else:
                rejected.append(Rejected(listener, sent, reception.arrival_ns, rejection))

    def _read(self, receptions: Sequence[Reception]) -> Iterator[Received]:
        trees, reports = self._open({r.message: r.arrival_ns for r in reversed(receptions)})
        for number, receiver, arrival_ns, power_dbm, sinr_db in receptions:
            listener, sent, tree = self._listeners[receiver], self._on_air[number], trees[number]
            known = self._maps[listener]
            if tree is None:
                verdict = known.receive_corrupt()
            elif number in reports:
                verdict = known.receive(reports[number], arrival_ns)
            elif message_type_of(sent.payload) is CPM:
                verdict = known.hear(self._objects(tree), arrival_ns)
            else:  # the map holds stations and objects
                verdict = Verdict.ACCEPTED
            yield Received(listener, sent, tree, arrival_ns, power_dbm, sinr_db, verdict)

    def _objects(self, tree: MessageTree) -> list[HeardObject] | None:
        try:
            return heard_objects(cpm_of_tree(tree), self._geodesy)
        except MessageError:  # without a position
            return None

    def _open(
        self, first_arrivals_ns: Mapping[int, int]
    ) -> tuple[dict[int, MessageTree | None], dict[int, LdmReport | None]]:
        """The decoded messages, and the reports of the CAMs among them, by number.

        Each is decoded once, however many stations receive it.
        """
        trees: dict[int, MessageTree | None] = {}
        cams: dict[int, CamCore] = {}
        decode = self._decoder or decode_cam_tree
        for number in first_arrivals_ns:
            payload = self._on_air[number].payload
            kind = message_type_of(payload)
            try:
                trees[number] = tree = decode(payload) if kind is CAM else kind.codec.decode(payload)
                if kind is CAM:
                    cams[number] = core_of_tree(tree)
            except MessageError:
                trees[number] = None
        arrivals_ns = [first_arrivals_ns[number] for number in cams]
        reports = reports_of_cams(list(cams.values()), arrivals_ns, self._geodesy)
        return trees, dict(zip(cams, reports, strict=True))


def _due(receptions: Iterable[Reception], until_ns: int) -> tuple[list[Reception], list[Reception]]:
    """Those that arrived by then, and the later ones, both in the order of arrival."""
    in_order = sorted(receptions, key=IN_ORDER)
    due = [reception for reception in in_order if reception.arrival_ns <= until_ns]
    return due, in_order[len(due) :]


def _transmissions(sent: Sequence[Sent], overhead_bytes: int) -> Transmissions:
    """overhead_bytes: what the radio adds to each message; a packet has its own instead."""
    return Transmissions(
        messages=np.array([message.number for message in sent], np.int64),
        keys=np.array([message.key for message in sent], np.uint64),
        senders=np.array([message.station_id for message in sent], np.int64),
        request_ns=np.array([message.request_ns for message in sent], np.int64),
        cam_bytes=np.array(
            [
                len(message.packet) + LINK_BYTES - overhead_bytes if message.packet else len(message.payload)
                for message in sent
            ],
            np.int64,
        ),
        power_dbm=np.array([message.power_dbm for message in sent], np.float64),
        contents=tuple(message.packet or message.payload for message in sent),
    )
