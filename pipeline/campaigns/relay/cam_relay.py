"""Relays the CAMs that a vehicle receives: attackers among their senders change, hold back and add some."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from advpipe.pipeline.campaigns.relay.cam_attacks import CamAttacks
from advpipe.pipeline.campaigns.relay.counts import RelayCounts
from advpipe.pipeline.campaigns.relay.heard_stations import HeardStations
from advpipe.pipeline.campaigns.relay.outgoing import (
    ADDED_BY_ATTACK,
    ATTACKED,
    UNCHANGED,
    OutgoingMessage,
)
from advpipe.pipeline.campaigns.relay.place import MapPlace
from advpipe.pipeline.campaigns.relay.recorder import Recorder
from advpipe.pipeline.campaigns.relay.settings import RelaySettings, vehicle_of
from advpipe.pipeline.labels.growing_table import GrowingTable
from advpipe.pipeline.labels.messages import FILE, MESSAGE_COLUMNS
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages.cam_cdr import cam_cdr
from advpipe.pipeline.messages.cam_from_cdr import cam_tree_of_cdr
from advpipe.pipeline.messages.cdr import stamp_of_header
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import typestore
from advpipe.pipeline.messages.v2x import reception_cdr, udp_packet_cdr
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.btp import cam_payload
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import encode_cam_tree
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.debug import claims_message
from advpipe.stages.attack.v2x.cams import CamEditor, field_of
from advpipe.stages.attack.v2x.labels import Labels

LONGEST_WAIT_NS = 20_000_000
"""A step of the attacks ends with the messages that have come, or after so long without any."""

MOST_REMEMBERED = 10_000
"""Messages whose bytes and arrival are remembered for attacks that hold them back."""


class _Arrived(NamedTuple):
    number: int
    cdr: bytes
    payload: bytes | None
    arrival_s: float


class CamRelay:
    """Where a station is, is what its own CAM says; that CAM is taken for genuine.

    Messages that are no CAM of a vehicle pass unchanged. Where no topic of packets is named, CAMs come and go
    as etsi_its_cam_msgs/CAM alone; what an attack makes that is no CAM is withheld then.
    """

    def __init__(
        self, settings: RelaySettings, specs: Sequence[AttackSpec], place: MapPlace, recorder: Recorder
    ) -> None:
        ego = VehicleTopics()
        self.counts = RelayCounts()
        packets = Topic(settings.packet_topic, ego.received_raw.type, ego.received_raw.qos)
        values = Topic(settings.cam_topic, ego.received_cam.type, ego.received_cam.qos)
        self.topics = tuple(topic for topic in (packets, values) if topic.name)
        self._has_packets = bool(settings.packet_topic)
        self._truth = VehicleTopics(vehicle_of(settings.packet_topic)).true_receptions
        self._settings, self._specs, self._place, self._recorder = settings, specs, place, recorder
        self._cams, self._stations = CamEditor(), HeardStations()
        self._attacks: CamAttacks | None = None
        self._labels: Labels | None = None
        self._arrived: list[_Arrived] = []
        self._remembered: dict[int, _Arrived] = {}
        self._order = deque[int]()
        self._start_ns = self._step_ns = 0
        self._power_dbm = V2x().radio.transmit_power_dbm
        CamAttacks(specs, settings.seed, self._cams, Geodesy(0.0, 0.0, 0.0))  # refuses bad parameters at once
        if place.is_known:
            self._prepare()

    def begin(self, start_ns: int) -> None:
        """Schedules count from here."""
        self._start_ns = self._step_ns = start_ns
        if self._attacks is not None:
            self._attacks.begin(start_ns)

    def take(self, cdr: bytes, now_ns: int, arrival_s: float) -> None:
        """A packet that has come."""
        self.counts.received += 1
        payload = _payload_of_packet(cdr) if self._has_packets else _payload_of_values(cdr)
        if payload is not None and self._attacks is None:
            self._locate(payload)
        number = self._attacks.next_number() if self._attacks is not None else -1
        self._arrived.append(_Arrived(number, cdr, payload, arrival_s))

    def due(self, now_ns: int, now_s: float) -> Iterator[OutgoingMessage]:
        """The packets that are to be sent by now."""
        if not self._arrived and now_ns - self._step_ns < LONGEST_WAIT_NS:
            return
        now_ns = max(now_ns, self._step_ns + 1)  # where /clock stands still, messages come all the same
        arrived, self._arrived = self._arrived, []
        begin_ns, self._step_ns = self._step_ns, now_ns
        if self._attacks is None or self._labels is None:
            for one in arrived:
                yield from self._messages(one.cdr, one.payload, UNCHANGED, one.arrival_s)
            return
        self._cams.forget()
        sent = []
        for one in arrived:
            if (message := self._sent(one, now_ns)) is None:
                yield from self._messages(one.cdr, None, UNCHANGED, one.arrival_s)
            else:
                self._remember(one)
                sent.append(message)
        yield from self._edited(self._attacks, self._labels, begin_ns, now_ns, sent)

    def end(self) -> None:
        """Nothing waits but what attacks hold back."""

    def write_labels(self) -> None:
        """Finish v2x_labels.parquet, if any position was received."""
        if self._labels is not None:
            self._labels.write(self._recorder.folder)

    def _edited(
        self, attacks: CamAttacks, labels: Labels, begin_ns: int, end_ns: int, sent: Sequence[Sent]
    ) -> Iterator[OutgoingMessage]:
        """The messages of one step after all attacks, those that attacks added first."""
        radios = (*self._stations.places(end_ns), *attacks.units)
        step = V2xStep(begin_ns, end_ns, radios, tuple(sent))
        labels.begin(step.sent)
        edited: Sequence[Sent] = list(sent)
        present = {radio.station_id for radio in radios}
        for index, attack in enumerate(attacks.built):
            if present.isdisjoint(attack.context.attackers):
                continue
            before, edited = edited, list(attack.edit(step, edited))
            labels.compare(index, attack, before, edited)
        if self._recorder.debug and (claims := claims_message(labels.claims())):
            self._recorder.record(claims[0], claims[1], end_ns)
        by_number = {message.number: message for message in sent}
        for message in sorted(edited, key=lambda one: (one.request_ns, one.number)):
            known = self._remembered.pop(message.number, None)
            if known is not None and message == by_number.get(message.number):
                self._record_truth(known.cdr, message, end_ns)
                yield from self._messages(known.cdr, known.payload, UNCHANGED, known.arrival_s)
                continue
            is_of_step = message.number in by_number
            if known is not None and not is_of_step:  # held back in an earlier step
                self.counts.withheld -= 1
            if (cdr := self._cdr(message)) is None:
                self.counts.withheld += known is not None
                continue
            arrival_s = known.arrival_s if known is not None and is_of_step else None
            fate = ADDED_BY_ATTACK if known is None else ATTACKED
            self._record_truth(cdr, message, end_ns)
            yield from self._messages(cdr, message.payload, fate, arrival_s)
        self.counts.withheld += len(by_number.keys() - {message.number for message in edited})

    def _messages(
        self, cdr: bytes, payload: bytes | None, fate: str, arrival_s: float | None
    ) -> Iterator[OutgoingMessage]:
        """The message, and its values beside the packet where it is a CAM that the message type can hold."""
        first, *beside = self.topics
        yield OutgoingMessage(first, cdr, fate, arrival_s)
        for topic in beside:
            if payload is not None and (values := self._values_of(payload)) is not None:
                yield OutgoingMessage(topic, values, fate, arrival_s)

    def _record_truth(self, packet_cdr: bytes, message: Sent, now_ns: int) -> None:
        """Which message a packet truly is, by its number in the labels; its stamp tells which packet."""
        if self._has_packets:
            stamp_ns = stamp_of_header(packet_cdr)
            cdr = reception_cdr(stamp_ns, message.number, message.station_id)
            self._recorder.record(self._truth, cdr, now_ns)

    def _cdr(self, message: Sent) -> bytes | None:
        """A message that an attack made, as consumers take it."""
        if self._has_packets:
            return udp_packet_cdr(message.request_ns, message.payload)
        return self._values_of(message.payload)

    def _values_of(self, payload: bytes) -> bytes | None:
        try:
            return cam_cdr(self._cams.decode(payload))
        except CamError:
            return None

    def _sent(self, one: _Arrived, now_ns: int) -> Sent | None:
        """The message as attacks see it, at the end of the step; None for what is no vehicle's CAM."""
        tree = None if one.payload is None else self._cams.open(one.payload)
        if tree is None or one.payload is None or self._attacks is None:
            return None
        station_id = self._stations.hear(tree, self._place.geodesy, now_ns)
        if station_id is None:
            return None
        self._attacks.meet(station_id)
        return Sent(one.number, 0, station_id, now_ns - 1, one.payload, self._power_dbm)

    def _remember(self, one: _Arrived) -> None:
        self._remembered[one.number] = one
        self._order.append(one.number)
        while len(self._order) > MOST_REMEMBERED:
            self._remembered.pop(self._order.popleft(), None)

    def _locate(self, payload: bytes) -> None:
        """The first CAM with a position makes the origin of the map, if no fix has made it."""
        tree = self._cams.open(payload)
        if tree is None:
            return
        place = [field_of(tree, name) for name in ("latitude_deg", "longitude_deg", "altitude_m")]
        if place[0] is not None and place[1] is not None:
            self._place.set_origin(place[0], place[1], place[2] or 0.0)
        if self._place.is_known:
            self._prepare().begin(self._start_ns)

    def _prepare(self) -> CamAttacks:
        geodesy = self._place.geodesy
        self._attacks = CamAttacks(self._specs, self._settings.seed, self._cams, geodesy)
        self._labels = Labels(
            self._cams,
            geodesy,
            self._attacks.names,
            V2x().ldm.expiry_s,
            self._attacks.declared,
            grown=GrowingTable(self._recorder.folder / FILE, MESSAGE_COLUMNS),
        )
        return self._attacks


def _payload_of_packet(cdr: bytes) -> bytes | None:
    try:
        packet: Any = typestore().deserialize_cdr(cdr, VehicleTopics().received_raw.type)
        return cam_payload(bytes(packet.data))
    except Exception:  # rosbags fails in any way on bytes that are no packet
        return None


def _payload_of_values(cdr: bytes) -> bytes | None:
    try:
        return encode_cam_tree(cam_tree_of_cdr(cdr))
    except CamError:
        return None
