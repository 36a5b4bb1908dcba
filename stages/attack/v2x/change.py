"""V2X attacks on a recorded drive: messages are changed, and then everything is transmitted again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cache, partial
from operator import attrgetter
from pathlib import Path

from advpipe.pipeline.bag.pseudonyms import radios_by_pseudonym
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.v2x_statistics import statistics_message
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.mcap.channel import RawMessage, StampedCdr, Topic
from advpipe.pipeline.messages.heard_objects import heard_objects_cdr
from advpipe.pipeline.messages.ldm import ldm_detections_cdr, ldm_snapshot_cdr
from advpipe.pipeline.messages.topics import (
    V2X_PACKETS,
    V2X_SENT,
    V2X_STATIONS,
    V2X_STATISTICS,
    VehicleTopics,
)
from advpipe.pipeline.messages.types import schema_text, type_hash
from advpipe.pipeline.messages.v2x import (
    own_messages,
    packet_messages,
    received_messages,
    rejected_message,
    sent_message,
    stations_message,
)
from advpipe.pipeline.replay.roads import roads_of_bag
from advpipe.pipeline.replay.v2x_attackers import AttackerSelection
from advpipe.pipeline.replay.v2x_drive import V2xDrive, V2xStep
from advpipe.pipeline.scenario.acting import acting_on_messages
from advpipe.pipeline.scenario.attacks import AttackSpec, Credentials, RadioOf
from advpipe.pipeline.v2x.channel import Channel, RadioMedium, Sent
from advpipe.pipeline.v2x.message_type import CAM, CPM, MESSAGE_TYPES, message_type_of
from advpipe.stages.attack.debug import DebugMessages, claims_message
from advpipe.stages.attack.recording import recording_of
from advpipe.stages.attack.v2x.base import AllocatedIds, AttackContext, MessageEditor, V2xAttack
from advpipe.stages.attack.v2x.build import build_attack
from advpipe.stages.attack.v2x.cams import CamEditor
from advpipe.stages.attack.v2x.congestion import Congestion
from advpipe.stages.attack.v2x.declared import declaration_of_messages
from advpipe.stages.attack.v2x.identities import StationIdentities
from advpipe.stages.attack.v2x.labels import Labels
from advpipe.stages.attack.v2x.object_labels import ObjectLabels
from advpipe.stages.attack.v2x.packets import AttackedPackets
from advpipe.stages.attack.v2x.radio import OpenRadio, radio_of
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS


def forge(
    reader: BagReader,
    attacks: Sequence[AttackSpec],
    seed: int,
    editors: Sequence[MessageEditor] = (),
    *,
    dcc_reacts: bool = False,
    network: RadioOf = "embedded",
    debug: DebugMessages | None = None,
) -> V2xChange:
    """The V2X of a recorded drive after these editors, and then these attacks, changed the sent messages.

    dcc_reacts: whether the benign stations' congestion control reacts to the channel load of the attacks
    (see `Congestion`); otherwise they send what they sent in the recording. network: whose radio sends them.
    debug: takes the claimed positions of the messages that are touched.

    Raises AdvpipeError for a bag without V2X or CAMs, an attacker or victim that is not in it, invalid
    parameters, a schedule outside the recording, and `dcc_reacts` without congestion control.
    """
    drive = V2xDrive(reader)
    radio = radio_of(reader, drive, network)
    if dcc_reacts and drive.v2x.cam.dcc == "none":
        raise UsageError(
            f"{reader.path} was recorded without congestion control (v2x.cam.dcc is none), so none "
            "can react; leave out dcc_reacts"
        )
    sent = reader.messages(V2X_SENT.name) if V2X_SENT.name in reader.topics else iter(())
    last = max((int(message.number) for _, message in sent), default=None)
    if last is None:
        raise UsageError(f"{reader.path} has no CAMs to attack; record more of the drive")
    recording, selection = recording_of(reader), AttackerSelection(drive, str(reader.path), seed)
    origin = drive.origin
    geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
    pseudonyms = set(radios_by_pseudonym(reader))
    cams, numbers = CamEditor(), AllocatedIds(last + 1, set(drive.stations) | pseudonyms)
    identities = StationIdentities()
    roads = cache(partial(roads_of_bag, reader))
    built: list[V2xAttack] = []
    for spec in attacks:
        recording.refuse_outside(spec)
        context = AttackContext(
            name=spec.type,
            seed=seed,
            seed_name=spec.seed_name,
            attackers=selection.attackers(spec),
            victim=selection.victim(spec),
            active=acting_on_messages(spec, recording.start_ns, seed),
            start_ns=recording.start_ns,
            v2x=drive.v2x,
            geodesy=geodesy,
            cams=cams,
            numbers=numbers,
            roads=roads,
            identities=identities,
        )
        built.append(_build(spec, context))
    numbers.station_ids |= set(selection.names)
    declared = {
        editor_index: declaration_of_messages(spec, V2X_ATTACKS.find(spec.type))
        for editor_index, spec in enumerate(attacks, len(editors))
    }
    labels = Labels(cams, geodesy, selection.names, drive.v2x.ldm.expiry_s, declared, identities)
    attackers = frozenset(number for attack in built for number in attack.context.attackers)
    congestion = Congestion(drive.v2x, attackers) if dcc_reacts else None
    packets = AttackedPackets(drive, _credentials(attacks, built))
    return V2xChange(reader, drive, selection, (*editors, *built), labels, congestion, packets, debug, radio)


def _credentials(attacks: Sequence[AttackSpec], built: Sequence[V2xAttack]) -> dict[int, Credentials]:
    """What each attacker signs with. Raises UsageError where two attacks disagree."""
    found: dict[int, Credentials] = {}
    for spec, attack in zip(attacks, built, strict=True):
        for attacker in attack.context.attackers:
            if found.setdefault(attacker, spec.credentials) != spec.credentials:
                raise UsageError(
                    f"{spec.type}: station {attacker} attacks with the credentials {found[attacker]!r} and "
                    f"{spec.credentials!r}; give it the same for all attacks"
                )
    return found


def _build(spec: AttackSpec, context: AttackContext) -> V2xAttack:
    attack = build_attack(spec, V2X_ATTACKS.find(spec.type), context)
    if CPM.name in attack.traits.message_types and context.v2x.cpm is None:
        raise UsageError(
            f"{spec.type} attacks CPMs, of which the drive has none; record it with v2x.cpm: {{}}"
        )
    if (
        attack.traits.needs_traffic
        and spec.attackers is not None
        and spec.attackers.roadside_unit is not None
    ):
        raise UsageError(
            f"{spec.type} changes the CAMs that a vehicle sends, but a roadside unit sends none; name "
            "vehicles as attackers"
        )
    return attack


class V2xChange:
    """A `Change` of all V2X topics of a bag; memory holds one step and the labels.

    held_back: how many messages the benign stations' congestion control held back.
    """

    def __init__(
        self,
        reader: BagReader,
        drive: V2xDrive,
        selection: AttackerSelection,
        editors: Sequence[MessageEditor],
        labels: Labels,
        congestion: Congestion | None,
        packets: AttackedPackets,
        debug: DebugMessages | None = None,
        radio: OpenRadio = nullcontext,
    ) -> None:
        self._radio = radio
        self._drive, self._units, self._editors = drive, tuple(selection.units), editors
        self._labels, self._congestion, self._debug = labels, congestion, debug
        self._packets = packets
        self._object_labels = ObjectLabels(drive.geodesy)
        self._cams = labels.cams
        own = {number: VehicleTopics(name) for number, name in drive.listeners.items()}
        self._own = own
        self._map_times_ns = {
            name: frozenset(reader.log_times_ns(topic).tolist() if topic in reader.topics else ())
            for name, topic in ((t.vehicle, t.ldm.name) for t in own.values())
        }
        self._has_statistics = V2X_STATISTICS.name in reader.topics
        self.topics = frozenset(
            topic.name
            for topic in (
                V2X_SENT,
                *([V2X_PACKETS] if V2X_PACKETS.name in reader.topics else ()),
                *([V2X_STATIONS] if self._units else ()),
                *([V2X_STATISTICS] if self._has_statistics else ()),
                *(topic for topics in own.values() for topic in _topics_of(topics)),
            )
        )
        self._stage = "new"

    @property
    def held_back(self) -> int:
        """The number of messages that the benign stations' congestion control held back."""
        return self._congestion.held_back if self._congestion else 0

    def messages(self) -> Iterator[RawMessage]:
        """Transmit the drive, only once; yields all messages of the topics in log-time order."""
        if self._stage != "new":
            raise RuntimeError("the messages of a V2xChange can be iterated only once")
        self._stage = "begun"
        sequences: Counter[str] = Counter()
        for topic, cdr, stamp_ns in self._stamped():
            full, schema = _described(topic)
            yield RawMessage(full, schema, cdr, stamp_ns, stamp_ns, sequences[topic.name])
            sequences[topic.name] += 1
        self._stage = "done"

    def write_labels(self, folder: Path) -> None:
        """Write `v2x_labels.parquet`, see `Labels`; transmits the drive if `messages` was not iterated."""
        if self._stage == "new":
            for _ in self.messages():
                pass
        if self._stage != "done":
            raise RuntimeError("labels are complete only after all messages have been iterated")
        self._labels.write(folder)
        self._object_labels.write(folder)

    def counts(self) -> Counter[str]:
        """The numbers of CAMs that were changed, added, delayed, dropped, made invalid, corrupt before the
        attack, or held back by the benign stations' congestion control; and the attacks that met no CAM."""
        counts = self._labels.counts.copy()
        for editor_index, editor in enumerate(self._editors):
            if isinstance(editor, V2xAttack) and editor_index not in self._labels.touching:
                counts[f"attack that met no CAM: {editor.name}"] += 1
        if self._congestion:
            counts["CAMs held back by others' congestion control"] = self.held_back
        return counts + self._packets.counts

    def channel(self, medium: RadioMedium | None = None) -> Channel:
        """The channel for the changed messages; CAMs that editors opened or closed are not decoded again."""
        return self._drive.channel(self._cams.decode, medium)

    def edited(self, step: V2xStep) -> list[Sent]:
        """The messages that are sent in a step after all edits; called for each step in order."""
        self._cams.forget()
        self._labels.identities.note(step.sent)
        self._labels.begin(step.sent)
        sent = list(step.sent)
        for editor_index, editor in enumerate(self._editors):
            names = editor.traits.message_types if isinstance(editor, V2xAttack) else (CAM.name,)
            before, sent = sent, sorted(_edited(editor, step, sent, names), key=_order)
            self._labels.compare(editor_index, editor, before, sent)
            if CPM.name in names:
                self._object_labels.compare(editor.name, before, sent)
        kept = self._congestion.allowed(step, sent) if self._congestion else sent
        return self._packets.packed(step.sent, kept)

    def _stamped(self) -> Iterator[StampedCdr]:
        """The messages as the simulation records them: step by step, in the order of stamps."""
        with self._radio() as medium:
            yield from self._transmitted(self.channel(medium))

    def _transmitted(self, channel: Channel) -> Iterator[StampedCdr]:
        pending, last_ns = list[StampedCdr](), 0
        for recorded in self._drive.steps():
            step = recorded._replace(radios=(*recorded.radios, *self._units))
            last_ns = step.begin_ns
            if self._units:
                pending.append(stations_message(step.begin_ns, step.radios))
            pending += self._maps(channel, step.begin_ns)
            yield from _by_stamp(pending)
            pending = list(self._send(channel, step))
        if self._has_statistics:
            last_ns = max((message[2] for message in pending), default=last_ns)
            pending.append(statistics_message(last_ns, channel.statistics()))
        yield from _by_stamp(pending)

    def _maps(self, channel: Channel, now_ns: int) -> Iterator[StampedCdr]:
        for name, times_ns in self._map_times_ns.items():
            if now_ns in times_ns:
                topics, snapshot = VehicleTopics(name), channel.snapshot(name, now_ns)
                yield topics.ldm, ldm_snapshot_cdr(snapshot), now_ns
                yield topics.ldm_objects, ldm_detections_cdr(snapshot), now_ns
                if self._drive.v2x.cpm is not None:
                    yield topics.heard_objects, heard_objects_cdr(snapshot), now_ns

    def _send(self, channel: Channel, step: V2xStep) -> Iterator[StampedCdr]:
        sent = list[Sent]()
        if step.end_ns is not None:
            sent = self.edited(step)
            if self._debug is not None and (claims := claims_message(self._labels.claims())):
                self._debug.add(*claims)
        result = self._drive.send(channel, step, sent)
        if self._congestion:
            self._congestion.observe(result.loads)
        self._packets.observe(result)
        present = {radio.station_id for radio in step.radios}
        for message in sent:
            yield sent_message(message)
            yield from packet_messages(message)
            if message.station_id in self._own and message.station_id in present:
                yield from own_messages(self._own[message.station_id], message)
        for received in result.received:
            yield from received_messages(received)
        yield from map(rejected_message, result.rejected)


_order = attrgetter("request_ns", "number")


def _edited(editor: MessageEditor, step: V2xStep, sent: Sequence[Sent], names: Sequence[str]) -> list[Sent]:
    """The messages after an editor, which sees those of the types with these names alone."""
    seen = tuple([one for one in sent if message_type_of(one.payload).name in names])
    if len(seen) == len(sent):
        return list(editor.edit(step, seen))
    others = [one for one in sent if message_type_of(one.payload).name not in names]
    return [*editor.edit(step, seen), *others]


def _by_stamp(messages: list[StampedCdr]) -> list[StampedCdr]:
    return sorted(messages, key=lambda message: message[2])


def _topics_of(topics: VehicleTopics) -> tuple[Topic, ...]:
    kinds = MESSAGE_TYPES.values()
    sent, received = map(topics.sent_values, kinds), map(topics.received_values, kinds)
    raw = topics.sent_raw, topics.received_raw, topics.reception_info, topics.true_receptions
    maps = topics.ldm, topics.ldm_objects, topics.heard_objects
    return *sent, *received, *raw, topics.rejections, *maps


@cache
def _described(topic: Topic) -> tuple[Topic, str]:
    return replace(topic, type_hash=type_hash(topic.type)), schema_text(topic.type)
